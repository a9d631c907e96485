/// Tells why there is nothing to map.
#pragma once

#include <ros/node_handle.h>
#include <ros/wall_timer.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ros/input/camera_input.hpp"
#include "ros/input/warning_throttle.hpp"

namespace frontier_surfels {

/// Looks once a second whether /clock and the topics of the cameras have brought anything. What is still missing after a few seconds is
/// told, and again every half a minute.
class InputWatch {
 public:
  using Tell = std::function<void(const std::string& sentence)>;

  /// @param cameras  that have been started, and live longer than this @param tell  is called by the callbacks of `nh`
  InputWatch(const ros::NodeHandle& nh, const std::vector<std::unique_ptr<CameraInput>>& cameras, Tell tell);

 private:
  void look();

  const std::vector<std::unique_ptr<CameraInput>>& cameras_;
  const Tell tell_;
  const WarningThrottle::Clock::time_point start_ = WarningThrottle::Clock::now();
  WarningThrottle told_{std::chrono::seconds(30)};
  ros::WallTimer timer_;  // not ROS time, which may be what is missing
};

}  // namespace frontier_surfels
