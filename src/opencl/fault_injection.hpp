/// Failures of the device on demand, for tests of what happens then.
#pragma once

#include <cstddef>
#include <limits>

#include "opencl/opencl.hpp"

namespace frontier_surfels {

/// Counts the calling thread's allocations and commands, and lets chosen ones fail. Costs one comparison per command.
class FaultInjection {
 public:
  /// The next `passing` allocations and commands succeed, the `failing` ones after these fail.
  static void fail(std::size_t passing, std::size_t failing) {
    count_ = 0;
    first_ = passing;
    failing_ = failing;
  }
  static void stop() { fail(std::numeric_limits<std::size_t>::max(), 0); }

  /// Number of allocations and commands since the last fail() or stop().
  static std::size_t count() { return count_; }

  /// Called before each allocation or command. @throws cl::Error  it is to fail
  static void step(const char* call, cl_int code = CL_OUT_OF_RESOURCES) {
    const std::size_t number = count_++;
    if (number >= first_ && number - first_ < failing_) throw cl::Error(code, call);
  }

 private:
  static inline thread_local std::size_t count_ = 0, first_ = std::numeric_limits<std::size_t>::max(), failing_ = 0;
};

}  // namespace frontier_surfels
