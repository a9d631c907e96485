/// Reads recorded frames one after the other, from any format. A new format is a new FrameSource that open_source() chooses.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "recordings/recorded_frame.hpp"

namespace frontier_surfels::replay {

/// Which part of a recording is read, and where a bag has the data.
struct SourceOptions {
  int first = 0;            ///< index of the first frame
  int last = -1;            ///< index of the last frame; -1: the end
  int stride = 1;           ///< every stride-th frame is read
  std::string depth_topic;  ///< in bags; empty: found by name and type
  std::string info_topic;   ///< in bags; empty: camera_info in the namespace of the depth images
  std::string color_topic;  ///< in bags; empty: found by name and type; "none": no colour
  std::string world_frame;  ///< in bags; empty: the root of the tf tree
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Number of frames that the options select, including those that turn out to be unusable.
  virtual std::size_t size() const = 0;
  /// The next usable frame; empty at the end. Frames that cannot be used are skipped, and skipped() gets a sentence for each.
  virtual std::optional<RecordedFrame> next() = 0;
  /// A sentence for each frame that was skipped: why it cannot be used.
  virtual const std::vector<std::string>& skipped() const = 0;
  /// Sentences about what was chosen or assumed because the recording does not say it, and about colour images that cannot be used.
  virtual const std::vector<std::string>& notes() const = 0;
  /// Sentences about faults of the recording from which a wrong map may come.
  virtual std::vector<std::string> warnings() const { return {}; }
  /// Name of the frame of the poses; empty if it has none.
  virtual std::string world_frame() const { return {}; }
  /// What to check if the camera should move but does not, as the end of a sentence.
  virtual std::string if_still() const { return {}; }
};

/// Opens a folder (depth/ + poses.txt + camera.txt, colour optional; or TUM RGB-D: depth.txt + groundtruth.txt, rgb.txt optional) or a bag.
/// @throws Error that says what is missing
std::unique_ptr<FrameSource> open_source(const std::string& path, const SourceOptions& options = {});

}  // namespace frontier_surfels::replay
