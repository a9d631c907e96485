/// Failures of the device on demand, for tests of what happens then; and the commands of a frame by kind, for tests of how many there are.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "opencl/opencl.hpp"

namespace frontier_surfels {

/// What the host asks of the device. A blocking read is a read and a wait: the device has nothing to do until the host goes on.
enum class Call { kLaunch, kFill, kCopy, kUpload, kRead, kWait, kAllocation };
constexpr std::size_t kCallKinds = 7;

/// Counts the calling thread's allocations and commands, and lets chosen ones fail. Costs one comparison per command.
class FaultInjection {
 public:
  /// The next `passing` allocations and commands succeed, the `failing` ones after these fail.
  static void fail(std::size_t passing, std::size_t failing) {
    count_ = 0;
    kinds_ = {};
    first_ = passing;
    failing_ = failing;
  }
  static void stop() { fail(std::numeric_limits<std::size_t>::max(), 0); }

  /// Number of allocations and commands since the last fail() or stop().
  static std::size_t count() { return count_; }

  /// The same, those of one kind. Waits count also where they are part of a read.
  static std::size_t count(Call kind) { return kinds_[static_cast<std::size_t>(kind)]; }

  /// Called before each allocation or command. @throws cl::Error  it is to fail
  static void step(Call kind, const char* call, cl_int code = CL_OUT_OF_RESOURCES) {
    ++kinds_[static_cast<std::size_t>(kind)];
    const std::size_t number = count_++;
    if (number >= first_ && number - first_ < failing_) throw cl::Error(code, call);
  }

  /// Called where a command also waits.
  static void waits() { ++kinds_[static_cast<std::size_t>(Call::kWait)]; }

 private:
  static inline thread_local std::size_t count_ = 0, first_ = std::numeric_limits<std::size_t>::max(), failing_ = 0;
  static inline thread_local std::array<std::size_t, kCallKinds> kinds_ = {};
};

}  // namespace frontier_surfels
