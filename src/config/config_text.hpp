/// Numbers and other values as text, the same in files, sentences and tables: in the C locale, whatever the program's locale is.
#pragma once

#include <string>

namespace frontier_surfels {

inline std::string to_text(bool value) { return value ? "true" : "false"; }
inline std::string to_text(int value) { return std::to_string(value); }
inline std::string to_text(const std::string& value) { return value; }

/// The shortest decimal text that reads back as the same number; .nan, .inf or -.inf as in YAML.
std::string to_text(double value);

/// Reads a number as YAML writes it; nothing may follow it. @return false if the text is none, or one that does not fit
bool from_text(const std::string& text, int& value);
bool from_text(const std::string& text, double& value);

}  // namespace frontier_surfels
