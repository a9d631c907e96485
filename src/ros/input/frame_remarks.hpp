/// What the user should know about frames that can be mapped, but from which nothing comes or a wrong map.
#pragma once

#include <sensor_msgs/CameraInfo.h>

#include <Eigen/Geometry>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/depth_census.hpp"
#include "frontier_surfels/types.hpp"
#include "ros/input/warning_throttle.hpp"

namespace frontier_surfels {

/// Looks at the frames of one camera. No ROS communication and no clock in it.
class FrameRemarks {
 public:
  using Warn = std::function<void(const std::string&)>;

  static constexpr int kStillFrames = 300;         ///< number of frames after which a camera that has not moved is remarked
  static constexpr std::size_t kDepthFrames = 30;  ///< number of frames after which depths of which few are usable are remarked

  /// @param warn  is given each remark as a sentence: the same about pixels every few seconds at most, all others once
  FrameRemarks(const Config& config, Warn warn) : config_(config), warn_(std::move(warn)) {}

  /// @param info  of the frame. @return the remarks about this frame as sentences; empty if there are none
  std::string on(const DepthFrame& frame, const sensor_msgs::CameraInfo& info, WarningThrottle::Clock::time_point now);

  /// Warns of pixels of which on() does not know, as those of colour images. The same every few seconds at most.
  void warn_of_pixels(const std::string& sentence, WarningThrottle::Clock::time_point now);

  /// Forgets the frames, but not what has been remarked once.
  void forget();

 private:
  std::string about_pixels(const DepthImage& image);
  std::string about_distortion(const sensor_msgs::CameraInfo& info);
  std::string about_size(const DepthImage& image);
  std::string about_motion(const Eigen::Isometry3d& T_world_camera);

  const Config config_;
  const Warn warn_;
  WarningThrottle pixel_warnings_{std::chrono::seconds(10)};
  std::deque<DepthCensus> depths_;         ///< of the last kDepthFrames frames
  std::deque<std::pair<int, int>> sizes_;  ///< the last sizes of images [pixel], each different from the one before
  std::optional<Eigen::Isometry3d> T_world_first_;
  int still_frames_ = 0;
  bool moved_ = false;
  bool distortion_told_ = false, sizes_told_ = false, motion_told_ = false;
};

}  // namespace frontier_surfels
