/// A run in numbers: summary.json, frames.csv and the table on the terminal.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "replay/run.hpp"

namespace frontier_surfels::replay {

/// Of a list of times. Median of an even number: mean of the middle two. 95th percentile by nearest rank: the smallest value that at
/// least 95 % do not exceed. Relative standard deviation: that of a sample (n - 1), in percent of the mean.
struct TimeStatistics {
  double mean = 0, median = 0, p95 = 0, max = 0, rsd_percent = 0;
};

/// @param values  not empty
TimeStatistics time_statistics(std::vector<double> values);

/// The frames that time figures are taken over: all but the first five, where there are more than ten.
std::vector<FrameRecord> warm_frames(const std::vector<FrameRecord>& frames);

/// Names of all stages in the order in which they run, those that did not run in the first frame included.
std::vector<std::string> stage_names(const std::vector<FrameRecord>& frames);

/// Times of whole frames, and mean and median of every stage [ms].
/// @param frames  not empty
/// @param names   of the stages
nlohmann::ordered_json time_json(const std::vector<FrameRecord>& frames, const std::vector<std::string>& names);

nlohmann::ordered_json config_json(const Config& config);
nlohmann::ordered_json octomap_json(const scoring::OctomapScore& score);
nlohmann::ordered_json exact_json(const scoring::ExactScore& score);

/// summary.json. `octomap` and `exact` are absent where there is no such score.
nlohmann::ordered_json summary_json(const Recording& recording, double octomap_resolution, const Run& run, const Yardsticks& yardsticks,
                                    const Scores& scores);

/// frames.csv: one line a frame; numbers read back exactly. The last column is absent where there is no OctoMap.
std::string frames_csv(const std::vector<FrameRecord>& frames);

/// One line a frame in TUM's format: stamp tx ty tz qx qy qz qw, camera to world.
std::string trajectory_text(const std::vector<FrameRecord>& frames);

/// The main figures of a summary.json, for a terminal.
std::string result_table(const nlohmann::ordered_json& summary);

/// @throws FileError
void write_file(const std::string& path, const std::string& content);

}  // namespace frontier_surfels::replay
