/// The same recording mapped again and again with one parameter varied, as the paper's figure 19 does.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "replay/run.hpp"

namespace frontier_surfels::replay {

struct Sweep {
  std::string parameter;
  std::vector<Config> configs;  ///< one a value, in ascending order
};

/// Reads PARAM=LO:HI:N: N equally spaced values from LO to HI of a numeric parameter; those of a whole-numbered one are rounded, and equal
/// ones left out.
/// @throws Error  the text is malformed, the parameter unknown or not a number, or a value out of its range
Sweep parse_sweep(const std::string& text, const Config& base);

/// Maps and scores once per value. Values that change what the yardsticks are made of get yardsticks of their own.
/// @return sweep.json: {parameter, unit, values: [{value, frames, surfels, time_ms_median, octomap {...}, exact {...}}]}
nlohmann::ordered_json run_sweep(const Sweep& sweep, const Recording& recording, const Yardsticks& yardsticks, double octomap_resolution,
                                 const std::function<bool()>& stop);

}  // namespace frontier_surfels::replay
