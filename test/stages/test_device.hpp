/// The OpenCL device that tests of stages run on.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <string>

#include "opencl/commands.hpp"

namespace frontier_surfels {

/// The OpenCL platform to test on, part of its name; empty: the first.
inline std::string test_platform() {
  const char* platform = std::getenv("FRONTIER_SURFELS_TEST_PLATFORM");
  return platform == nullptr ? "" : platform;
}

/// Which device to test on, and at which width: FRONTIER_SURFELS_TEST_LANES is 16 or 1; without it the width is the device's own.
inline Config test_config() {
  Config config;
  config.platform = test_platform();
  const char* lanes = std::getenv("FRONTIER_SURFELS_TEST_LANES");
  if (lanes != nullptr) set_field(config, "lanes", lanes);
  return config;
}

inline Device test_device() { return choose_device(test_config()); }

/// Built once a program: compiling the kernels takes longer than most tests. Never destroyed: at the program's end a driver may be gone
/// before it.
inline Commands& test_commands() {
  static auto* const commands = new Commands(test_device());
  return *commands;
}

/// The same with one thread; null where the device cannot be limited to that.
inline std::unique_ptr<Commands> one_thread_commands() {
  const auto parts = test_commands().device().device.getInfo<CL_DEVICE_PARTITION_PROPERTIES>();
  if (std::find(parts.begin(), parts.end(), CL_DEVICE_PARTITION_BY_COUNTS) == parts.end()) return nullptr;
  Config one = test_config();
  one.threads = 1;
  return std::make_unique<Commands>(choose_device(one));
}

}  // namespace frontier_surfels
