/// Values of Config fields as text, the same in YAML files, sentences and tables.
#pragma once

#include <string>

namespace frontier_surfels {

inline std::string to_text(bool value) { return value ? "true" : "false"; }
inline std::string to_text(int value) { return std::to_string(value); }
inline std::string to_text(const std::string& value) { return value; }

/// The shortest decimal text that reads back as the same number; .nan, .inf or -.inf as in YAML.
std::string to_text(double value);

}  // namespace frontier_surfels
