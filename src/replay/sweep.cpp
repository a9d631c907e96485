#include "replay/sweep.hpp"

#include <cmath>
#include <iostream>
#include <regex>
#include <type_traits>

#include "config/c_locale.hpp"
#include "replay/summary.hpp"

namespace frontier_surfels::replay {
namespace {

using nlohmann::ordered_json;

constexpr int kMostValues = 1000;

/// Whether fields of this type are numbers. A bool is not one.
template <typename Field>
constexpr bool kIsNumber = std::is_arithmetic_v<Field> && !std::is_same_v<Field, bool>;

/// @return whether there is a numeric field of that name
bool set_number(Config& config, const std::string& name, double value) {
  bool found = false;
  for_each_field(config, [&](const FieldInfo& info, auto& field) {
    using Field = std::decay_t<decltype(field)>;
    if constexpr (kIsNumber<Field>) {
      if (name != info.name) return;
      field = static_cast<Field>(std::is_integral_v<Field> ? std::round(value) : value);
      found = true;
    }
  });
  return found;
}

double number(const Config& config, const std::string& name) { return config_json(config).at(name).get<double>(); }

std::string unit_of(const std::string& name) {
  std::string unit;
  const Config config;
  for_each_field(config, [&](const FieldInfo& info, const auto&) {
    if (name == info.name) unit = info.unit;
  });
  return unit;
}

/// @throws std::exception if the text is not a number
double parse_number(const std::string& text) {
  const CLocale c_locale;
  std::size_t end = 0;
  const double value = std::stod(text, &end);
  if (end != text.size() || !std::isfinite(value) || std::abs(value) > 1e9) throw std::invalid_argument(text);
  return value;
}

void check(const Config& config, const std::string& parameter) {
  std::string problems;
  for (const std::string& problem : config.problems()) problems += " " + problem;
  if (!problems.empty()) throw Error("--sweep: " + parameter + " = " + ordered_json(number(config, parameter)).dump() + ":" + problems);
}

ordered_json point_json(double value, const Run& run, const Scores& scores) {
  std::vector<double> total_ms;
  for (const FrameRecord& frame : warm_frames(run.frames)) total_ms.push_back(frame.report.total_ms);
  ordered_json point = {{"value", value},
                        {"frames", run.frames.size()},
                        {"surfels", run.surfels.size()},
                        {"time_ms_median", time_statistics(total_ms).median}};
  if (scores.octomap) point["octomap"] = octomap_json(*scores.octomap);
  if (scores.exact) point["exact"] = exact_json(*scores.exact);
  if (scores.truth) point["truth"] = exact_json(*scores.truth);
  return point;
}

}  // namespace

Sweep parse_sweep(const std::string& text, const Config& base) {
  if (!base.map_folder.empty())
    throw Error("--sweep: every value begins with an empty map, but map_folder '" + base.map_folder +
                "' would keep the map of the one before: leave map_folder out.");
  static const std::regex kForm("([a-z_0-9]+)=([^:]+):([^:]+):([0-9]{1,4})");
  std::smatch part;
  if (!std::regex_match(text, part, kForm)) throw Error("--sweep '" + text + "' is not of the form PARAM=LO:HI:N, as in th_d=0.01:0.42:9.");
  double low = 0;
  double high = 0;
  try {
    low = parse_number(part[2]);
    high = parse_number(part[3]);
  } catch (const std::exception&) {
    throw Error("--sweep '" + text + "': LO and HI must be numbers.");
  }
  const int count = std::stoi(part[4]);
  if (!(low < high) || count < 2 || count > kMostValues) {
    throw Error("--sweep '" + text + "': LO must be below HI, and N from 2 to " + std::to_string(kMostValues) + ".");
  }

  Sweep sweep{part[1], {}};
  for (int i = 0; i < count; ++i) {
    Config config = base;
    if (!set_number(config, sweep.parameter, low + (high - low) * i / (count - 1))) {
      throw Error("--sweep: there is no numeric parameter '" + sweep.parameter + "'; --parameters lists them all.");
    }
    check(config, sweep.parameter);
    const bool repeated = !sweep.configs.empty() && number(sweep.configs.back(), sweep.parameter) == number(config, sweep.parameter);
    if (!repeated) sweep.configs.push_back(config);
  }
  return sweep;
}

ordered_json run_sweep(const Sweep& sweep, const Recording& recording, const Yardsticks& yardsticks,
                       const OctomapResolution& octomap_resolution, const std::function<bool()>& stop) {
  ordered_json values = ordered_json::array();
  for (const Config& config : sweep.configs) {
    if (stop()) break;
    const double value = number(config, sweep.parameter);
    std::cerr << "Sweep: " << sweep.parameter << " = " << value << "\n";
    std::optional<Yardsticks> own;
    if (!yardsticks.fit(config))
      own.emplace(config, octomap_resolution, yardsticks.exact().has_value(), yardsticks.truth() ? yardsticks.truth()->folder() : nullptr);
    const Run run = map_recording(recording, config, own ? &*own : nullptr, stop);
    if (run.stopped) break;  // the scores of a part of the recording cannot be compared with the others
    values.push_back(point_json(value, run, score_map(run.surfels, own ? *own : yardsticks, config.threads)));
  }
  return {{"parameter", sweep.parameter}, {"unit", unit_of(sweep.parameter)}, {"values", values}};
}

}  // namespace frontier_surfels::replay
