#include "replay/warnings.hpp"

#include <algorithm>

namespace frontier_surfels::replay {
namespace {

constexpr double kStillDistance = 1e-4;  // [m], below the noise of any tracked pose
constexpr double kStillRotation = 1e-4;  // largest difference of a rotation matrix' elements

/// A sentence about all frames that cannot be used for one reason.
/// @param frames  "3 of 7 depth images"
/// @param depths  the sum over these frames
std::string sentence(const std::string& reason, const std::string& frames, const DepthCensus& depths, const Config& config) {
  if (reason == "no_measurement")
    return frames +
           " have no measurement in any pixel (0 or NaN): check that the camera delivers depth, and that the right depth topic "
           "or folder is chosen.";
  if (reason == "saturated")
    return frames + " are 65535 in every pixel that is not 0, which means no measurement: check the camera and its driver.";
  if (reason == "no_agreement") return frames + " have " + no_agreement(config);
  return frames + " have no depth from " + depth_range(config) + ", only depths " + range_and_remedy(depths, config);
}

void warn_of_depths(const Run& run, std::vector<std::string>& warnings) {
  for (const char* reason : {"no_measurement", "saturated", "too_near", "too_far", "out_of_range", "no_agreement"}) {
    DepthCensus depths;
    std::size_t count = 0;
    for (const FrameRecord& frame : run.frames) {
      if (frame.depths.reason() != reason) continue;
      depths += frame.depths;
      ++count;
    }
    const std::string frames = std::to_string(count) + " of " + std::to_string(run.frames.size()) + " depth images";
    if (count > 0) warnings.push_back(sentence(reason, frames, depths, run.config));
  }
}

/// Warns of a wrong unit with which some depths happen to be usable.
void warn_of_few_depths(const Run& run, std::vector<std::string>& warnings) {
  DepthCensus all;
  for (const FrameRecord& frame : run.frames)
    if (frame.depths.usable > 0) all += frame.depths;
  const std::string few = few_in_range(all, run.config);
  if (!few.empty()) warnings.push_back(few);
}

}  // namespace

bool is_still(const std::vector<FrameRecord>& frames) {
  if (frames.size() < 2) return false;
  const Eigen::Isometry3d& first = frames.front().T_world_camera;
  return std::all_of(frames.begin(), frames.end(), [&](const FrameRecord& frame) {
    const Eigen::Isometry3d& pose = frame.T_world_camera;
    return (pose.translation() - first.translation()).norm() <= kStillDistance &&
           (pose.linear() - first.linear()).cwiseAbs().maxCoeff() <= kStillRotation;
  });
}

std::vector<std::string> warnings(const Run& run) {
  std::vector<std::string> all;
  warn_of_depths(run, all);
  warn_of_few_depths(run, all);
  all.insert(all.end(), run.remarks.begin(), run.remarks.end());
  if (is_still(run.frames))
    all.push_back("The camera never moves: all " + std::to_string(run.frames.size()) + " frames have the same pose in the frame '" +
                  run.world_frame + "'" + (run.if_still.empty() ? "" : "; if it did move, " + run.if_still) + ".");
  if (!run.unsaved.empty()) all.push_back(run.unsaved);
  return all;
}

std::string reason(const FrameRecord& frame, bool still) {
  const std::string depths = frame.depths.reason();
  return depths.empty() && still ? "still_camera" : depths;
}

}  // namespace frontier_surfels::replay
