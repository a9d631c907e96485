/// Limits how often something is done.
#pragma once

#include <chrono>
#include <optional>

namespace frontier_surfels {

/// Counts in steady time. For one thread.
class Throttle {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Throttle(Clock::duration between) : between_(between) {}

  /// Whether it may be done now, which is then counted as done.
  bool is_due(Clock::time_point now) {
    if (last_ && now - *last_ < between_) return false;
    last_ = now;
    return true;
  }

 private:
  const Clock::duration between_;
  std::optional<Clock::time_point> last_;
};

}  // namespace frontier_surfels
