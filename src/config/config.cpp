#include "frontier_surfels/config.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <locale>
#include <numeric>
#include <sstream>
#include <type_traits>

#include "config/config_text.hpp"

namespace frontier_surfels {
namespace {

template <typename T>
constexpr bool kIsNumber = std::is_same_v<T, int> || std::is_same_v<T, double>;

std::string range_text(const FieldInfo& info) { return to_text(info.lowest) + " to " + to_text(info.highest); }

std::string with_unit(const std::string& value, const FieldInfo& info) { return *info.unit ? value + " " + info.unit : value; }

/// Levenshtein distance: number of letters to add, drop or replace to turn `a` into `b`.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// Reads a number, also one with 0x, as yaml-cpp does.
template <typename Number>
bool read_number(const std::string& text, Number& value) {
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  stream.unsetf(std::ios::dec);
  Number number = 0;
  if (!(stream >> std::noskipws >> number) || !(stream >> std::ws).eof()) return false;
  value = number;
  return true;
}

}  // namespace

bool from_text(const std::string& text, int& value) { return read_number(text, value); }

bool from_text(const std::string& text, double& value) {
  using Limits = std::numeric_limits<double>;
  const auto is_word = [](std::string word, const char* lower, const char* title, const char* upper) {
    if (!word.empty() && (word[0] == '+' || word[0] == '-')) word.erase(0, 1);
    return word == lower || word == title || word == upper;
  };
  if (is_word(text, ".inf", ".Inf", ".INF"))
    value = text[0] == '-' ? -Limits::infinity() : Limits::infinity();
  else if (text[0] == '.' && is_word(text, ".nan", ".NaN", ".NAN"))
    value = Limits::quiet_NaN();
  else
    return read_number(text, value);
  return true;
}

std::string to_text(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0 ? ".inf" : "-.inf";
  using Digits = std::numeric_limits<double>;
  for (int digits = Digits::digits10;; ++digits) {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text.precision(digits);
    text << value;
    std::istringstream back(text.str());
    back.imbue(std::locale::classic());
    double read = 0;
    if ((back >> read && read == value) || digits == Digits::max_digits10) return text.str();
  }
}

std::string suggestion(const std::string& name, const std::vector<std::string>& more) {
  std::vector<std::string> names = more;
  const Config defaults;
  for_each_field(defaults, [&](const FieldInfo& info, const auto&) { names.push_back(info.name); });
  std::string nearest;
  std::size_t smallest = 2 + name.size() / 4;  // more edits mean another word
  for (const std::string& candidate : names) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance < smallest) {
      smallest = distance;
      nearest = candidate;
    }
  }
  return nearest.empty() ? "; doc/parameters.md lists all parameters." : "; did you mean '" + nearest + "'?";
}

std::vector<std::string> Config::problems() const {
  std::vector<std::string> faults;
  for_each_field(*this, [&](const FieldInfo& info, const auto& value) {
    if constexpr (kIsNumber<std::decay_t<decltype(value)>>) {
      if (value >= info.lowest && value <= info.highest) return;  // false for NaN
      faults.push_back(std::string(info.name) + " is " + with_unit(to_text(value), info) + ": it must be from " +
                       with_unit(range_text(info), info) + ".");
    }
  });
  if (lanes > 1 && lanes < 16) faults.push_back("lanes is " + std::to_string(lanes) + ": it must be 0, 1 or 16.");
  if (z_max <= z_min) {
    faults.push_back("z_max is " + to_text(z_max) + " m, but z_min is " + to_text(z_min) + " m: z_max must be larger.");
  }
  if (!map_folder.empty() && eviction_radius < 3 * z_max) {
    faults.push_back("eviction_radius is " + to_text(eviction_radius) + " m: it must be at least three times z_max, which is " +
                     to_text(z_max) + " m.");
  }
  if (sampling != "mean" && sampling != "nearest") faults.push_back("sampling is '" + sampling + "': it must be mean or nearest.");
  if (device_type != "any" && device_type != "cpu" && device_type != "gpu" && device_type != "accelerator") {
    faults.push_back("device_type is '" + device_type + "': it must be any, cpu, gpu or accelerator.");
  }
  return faults;
}

void ParameterTable::operator()(const FieldInfo& info, bool value) { add_row(info, to_text(value), ""); }
void ParameterTable::operator()(const FieldInfo& info, int value) { add_row(info, to_text(value), range_text(info)); }
void ParameterTable::operator()(const FieldInfo& info, double value) { add_row(info, to_text(value), range_text(info)); }
void ParameterTable::operator()(const FieldInfo& info, const std::string& value) { add_row(info, value.empty() ? "\"\"" : value, ""); }

void ParameterTable::add_row(const FieldInfo& info, const std::string& value, const std::string& range) {
  if (text_.empty() || group_ != info.group) {
    group_ = info.group;
    text_ += "\n## " + group_ + "\n\n| parameter | default | unit | range | meaning |\n|---|---|---|---|---|\n";
  }
  text_ += std::string("| `") + info.name + "` | " + value + " | " + info.unit + " | " + range + " | " + info.meaning + " |\n";
}

std::string parameter_table() {
  ParameterTable table;
  const Config defaults;
  for_each_field(defaults, table);
  return table.text();
}

}  // namespace frontier_surfels
