/// The figures of a run: summary.json, frames.csv, and the table on the terminal.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "replay/run.hpp"

namespace frontier_surfels::replay {

/// Statistics of a list of times. The median of an even number of values is the mean of the middle two. p95 is the smallest value that is
/// not exceeded by at least 95 % of the values. rsd_percent is the standard deviation of a sample (n - 1) in percent of the mean.
struct TimeStatistics {
  double mean = 0, median = 0, p95 = 0, max = 0, rsd_percent = 0;
};

/// @param values  not empty
TimeStatistics time_statistics(std::vector<double> values);

/// The frames whose times count: all but the first five, or all if there are no more than ten.
std::vector<FrameRecord> warm_frames(const std::vector<FrameRecord>& frames);

/// Names of all stages in the order in which they run, also of those that run only in some frames.
std::vector<std::string> stage_names(const std::vector<FrameRecord>& frames);

/// Statistics of whole frames, and mean and median of every stage [ms].
/// @param frames  not empty
/// @param names   names of the stages
nlohmann::ordered_json time_json(const std::vector<FrameRecord>& frames, const std::vector<std::string>& names);

nlohmann::ordered_json config_json(const Config& config);
nlohmann::ordered_json octomap_json(const scoring::OctomapScore& score);
nlohmann::ordered_json exact_json(const scoring::ExactScore& score);

/// The content of summary.json. `octomap`, `exact`, `truth` and `objects` are absent if there are no such scores, `cpu_ms` if the mapper
/// ran in another process, and `pose_corrections` if there are none. `warnings` are those of warnings(), `reasons` tells how many frames
/// added nothing for each reason, `map_checksum` is map_checksum() of the surfels, `notes` are those of the source, and `skipped` has a
/// sentence for each skipped frame.
nlohmann::ordered_json summary_json(const Recording& recording, const Run& run, const Yardsticks& yardsticks, const Scores& scores);

/// The content of frames.csv: a line for each frame, with numbers that are read back exactly. The column octomap_ms is absent without an
/// OctoMap. The last column is the reason why a frame adds nothing to the map, see reason(); it is empty for most frames.
std::string frames_csv(const std::vector<FrameRecord>& frames);

/// The poses with which the frames were mapped, in the format of TUM RGB-D, a line for each frame: stamp tx ty tz qx qy qz qw, camera to
/// world.
std::string trajectory_text(const std::vector<FrameRecord>& frames);

/// The error for a recording whose frames were mapped, but left the map empty. @param warnings  about the run
Error empty_map(const std::string& path, const std::vector<std::string>& warnings);

/// The main figures of a summary.json, for a terminal.
std::string result_table(const nlohmann::ordered_json& summary);

/// Writes a file beside `path`, and puts it there when it is complete. @throws FileError
void write_file(const std::string& path, const std::string& content);

}  // namespace frontier_surfels::replay
