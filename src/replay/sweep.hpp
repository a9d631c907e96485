/// Maps a recording repeatedly while one parameter varies, as in the paper's figure 19.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "replay/run.hpp"

namespace frontier_surfels::replay {

struct Sweep {
  std::string parameter;
  std::vector<Config> configs;  ///< one for each value, in ascending order
};

/// Reads PARAM=LO:HI:N, which is N equally spaced values from LO to HI of a numeric parameter. Values of a whole-numbered parameter are
/// rounded, and repeated values are left out.
/// @throws Error  if the text is malformed, the parameter is unknown or not numeric, or a value is out of its range
Sweep parse_sweep(const std::string& text, const Config& base);

/// Maps the recording and scores the map once for each value. A value that changes the depth range or the pixels gets its own yardsticks.
/// @return sweep.json: {parameter, unit, values: [{value, frames, surfels, time_ms_median, octomap {...}, exact {...}}]}
nlohmann::ordered_json run_sweep(const Sweep& sweep, const Recording& recording, const Yardsticks& yardsticks,
                                 const OctomapResolution& octomap_resolution, const std::function<bool()>& stop);

}  // namespace frontier_surfels::replay
