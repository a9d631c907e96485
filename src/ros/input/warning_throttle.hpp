/// Limits how often warnings are given, each kind for itself.
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "ros/input/throttle.hpp"

namespace frontier_surfels {

/// The sentence with # for each number, so that sentences that differ only in numbers are of one kind. Numbers within names stay.
std::string kind_of(const std::string& sentence);

/// A warning of one kind never hides one of another kind, as it would with ROS_WARN_THROTTLE, which is also silent while ROS time is 0. For
/// one thread.
class WarningThrottle {
 public:
  using Clock = Throttle::Clock;

  static constexpr std::size_t kMostKinds = 20;  ///< that are warned of within the time: damaged messages may have any text

  /// @param between  shortest time between two warnings of one kind
  explicit WarningThrottle(Clock::duration between) : between_(between) {}

  /// To be called whenever there is something to warn of.
  /// @return 0 if the warning must not be given now; else how often it has come since it was given last, this time included
  std::size_t due(const std::string& sentence, Clock::time_point now);

 private:
  struct Kind {
    Clock::time_point told;
    std::size_t hidden = 0;  ///< warnings since
  };

  const Clock::duration between_;
  std::map<std::string, Kind> kinds_;
};

}  // namespace frontier_surfels
