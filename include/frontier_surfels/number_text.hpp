/// Numbers in sentences, tables and diagnostics: in the C locale, whatever locale the program has, which may be a nodelet manager.
#pragma once

#include <algorithm>
#include <charconv>
#include <string>

namespace frontier_surfels {

/// With `digits` digits behind the point, at most 20.
inline std::string fixed_text(double value, int digits) {
  char text[400];  // the largest double has 309 digits before the point
  return {text, std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, std::min(digits, 20)).ptr};
}

/// With at most `digits` significant digits.
inline std::string rounded_text(double value, int digits) {
  char text[400];
  return {text, std::to_chars(text, text + sizeof text, value, std::chars_format::general, digits).ptr};
}

}  // namespace frontier_surfels
