/// Recorded frames one after the other, whatever they were recorded in.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "recordings/recorded_frame.hpp"

namespace frontier_surfels::replay {

/// Which part of a recording is read, and where its data are found in a bag.
struct SourceOptions {
  int first = 0;            ///< index of the first frame
  int last = -1;            ///< index of the last frame; -1: the end
  int stride = 1;           ///< every so many frames
  std::string depth_topic;  ///< bags; empty: found by name and type, or an Error that lists the candidates
  std::string info_topic;   ///< bags; empty: camera_info beside the depth image
  std::string color_topic;  ///< bags; empty: found by name and type; "none": no colour
  std::string world_frame;  ///< bags; empty: the root of the tf tree
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Frames that next() will be asked for, after first, last and stride; the unusable ones among them are counted as well.
  virtual std::size_t size() const = 0;
  /// The next usable frame; empty at the end. Frames that cannot be used are passed over and counted in skipped().
  virtual std::optional<RecordedFrame> next() = 0;
  /// Why frames were passed over: a sentence each.
  virtual const std::vector<std::string>& skipped() const = 0;
  /// What was chosen or assumed where the recording does not say it, and colour images that could not be used: a sentence each.
  virtual const std::vector<std::string>& notes() const = 0;
};

/// Opens a folder (depth/ + poses.txt + camera.txt, colour optional; or TUM RGB-D: depth.txt + groundtruth.txt, rgb.txt optional) or a bag.
/// @throws Error: a sentence that names what is missing
std::unique_ptr<FrameSource> open_source(const std::string& path, const SourceOptions& options = {});

}  // namespace frontier_surfels::replay
