/// What the node does about a map folder that cannot be written, and about the mapper's warnings.
#pragma once

#include <chrono>
#include <string>

#include "frontier_surfels/mapper.hpp"
#include "ros/input/throttle.hpp"

namespace frontier_surfels {

/// Logs the mapper's warnings, and the fault of its folder. Tries to write every few seconds, also while no frames come. No ROS
/// communication and no clock in it.
class MapFolderWatch {
 public:
  explicit MapFolderWatch(Mapper& mapper) : mapper_(mapper) {}

  /// To be called about once a second, on the thread of the mapper. @return why the folder cannot be written; empty if all is well
  std::string look(Throttle::Clock::time_point now);

 private:
  Mapper& mapper_;
  Throttle tries_{std::chrono::seconds(5)};
  std::string logged_;  ///< the fault that was logged last; empty if none is left
};

}  // namespace frontier_surfels
