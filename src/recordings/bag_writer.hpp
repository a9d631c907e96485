/// Writes recorded frames as a bag.
#pragma once

#include <cstddef>
#include <string>

#include "recordings/frame_source.hpp"

namespace frontier_surfels::replay {

/// By default, topics and tf frames are those of the TUM RGB-D benchmark's bags, with leading slashes.
struct BagOptions {
  std::string depth_topic = "/camera/depth/image";
  std::string depth_info_topic = "/camera/depth/camera_info";
  std::string color_topic = "/camera/rgb/image_color";
  std::string color_info_topic = "/camera/rgb/camera_info";
  double depth_unit = 0.001;       ///< one step of the recording's 16-bit images [m]
  std::string encoding = "32FC1";  ///< of depth images: 32FC1 [m] or 16UC1 [mm]
  bool compressed =
      false;  ///< writes compressedDepth (16UC1 lossless; 32FC1 quantised, up to 10 m) and JPEG, on topics with these suffixes
  std::string compression = "lz4";  ///< of the bag: none, lz4, bz2
  bool leading_slashes = true;      ///< of the names of tf frames
  bool static_transforms = false;   ///< writes constant transforms once to /tf_static, latched; else to /tf with each frame
};

struct BagSummary {
  std::size_t frames = 0;
  double stamp_shift = 0;  ///< [s] added to all stamps
};

/// Writes the remaining frames of `source` to `path`, through a temporary file beside it. ROS has no time 0, which tf takes for "the
/// latest": if the first stamp is below 1 s, all stamps are shifted by whole seconds, so that the first one is 1 s or more.
/// @throws Error
BagSummary write_bag(FrameSource& source, const std::string& path, const BagOptions& options = {});

}  // namespace frontier_surfels::replay
