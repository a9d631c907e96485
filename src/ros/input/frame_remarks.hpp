/// What the user should know about frames that can be mapped, but from which nothing comes or a wrong map.
#pragma once

#include <sensor_msgs/CameraInfo.h>

#include <Eigen/Geometry>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/depth_census.hpp"
#include "frontier_surfels/types.hpp"
#include "ros/input/warning_throttle.hpp"

namespace frontier_surfels {

/// Looks at the camera_infos and the sizes of images that come as those of one camera.
class CameraRemarks {
 public:
  /// @param choose_depth  how to choose other depth images, for instance "remap depth/image to"
  /// @param choose_camera  the whole sentence that says how to choose the topics of one camera
  CameraRemarks(std::string choose_depth, std::string choose_camera)
      : choose_depth_(std::move(choose_depth)), choose_camera_(std::move(choose_camera)) {}

  /// @param info  of the next image. @return remarks that were not made before, as sentences
  std::vector<std::string> on(const DepthImage& image, const sensor_msgs::CameraInfo& info);

  /// Forgets the images, but not what has been remarked.
  void forget() { sizes_.clear(); }

 private:
  std::string about_distortion(const sensor_msgs::CameraInfo& info);
  std::string about_size(const DepthImage& image);

  const std::string choose_depth_, choose_camera_;
  std::deque<std::pair<int, int>> sizes_;  ///< the last sizes of images [pixel], each different from the one before
  bool distortion_told_ = false, sizes_told_ = false;
};

/// Looks at the frames of one camera. No ROS communication and no clock in it.
class FrameRemarks {
 public:
  using Warn = std::function<void(const std::string&)>;

  static constexpr int kStillFrames = 300;         ///< number of frames after which a camera that has not moved is remarked
  static constexpr std::size_t kDepthFrames = 30;  ///< number of frames after which depths of which few are usable are remarked
  static constexpr int kFarFrames = 300;           ///< the same with carve_beyond_range: far depths are usual then

  /// @param warn  is given each remark as a sentence: the same about pixels every few seconds at most, all others once
  FrameRemarks(const Config& config, Warn warn) : config_(config), warn_(std::move(warn)) {}

  /// @param measured_pixels  Report::measured_pixels of the frame
  /// @param info             of the frame
  /// @return the remarks about this frame as sentences; empty if there are none
  std::string on(const DepthFrame& frame, std::size_t measured_pixels, const sensor_msgs::CameraInfo& info,
                 WarningThrottle::Clock::time_point now);

  /// Warns of pixels of which on() does not know, as those of colour images. The same every few seconds at most.
  void warn_of_pixels(const std::string& sentence, WarningThrottle::Clock::time_point now);

  /// Forgets the frames, but not what has been remarked once.
  void forget();

 private:
  std::string about_pixels(const DepthCensus& depths);
  std::string about_far(const DepthCensus& depths);
  std::string about_motion(const Eigen::Isometry3d& T_world_camera);

  const Config config_;
  const Warn warn_;
  WarningThrottle pixel_warnings_{std::chrono::seconds(10)};
  std::deque<DepthCensus> depths_;  ///< of the last kDepthFrames frames
  CameraRemarks camera_remarks_{"remap depth/image to", "Remap depth/image and depth/camera_info to the topics of one camera."};
  std::optional<Eigen::Isometry3d> T_world_first_;
  DepthCensus far_depths_;  ///< of far_frames_ frames with usable pixels
  int far_frames_ = 0;
  int still_frames_ = 0;
  bool moved_ = false;
  bool motion_told_ = false, far_told_ = false;
};

}  // namespace frontier_surfels
