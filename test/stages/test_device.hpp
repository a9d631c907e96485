/// The OpenCL device for the tests of stages.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "opencl/commands.hpp"

namespace frontier_surfels {

/// Part of the name of the OpenCL platform to test; empty: the first platform.
inline std::string test_platform() {
  const char* platform = std::getenv("FRONTIER_SURFELS_TEST_PLATFORM");
  return platform == nullptr ? "" : platform;
}

/// Configuration with the platform to test, and the lanes from FRONTIER_SURFELS_TEST_LANES (16 or 1); without it the device's own number.
inline Config test_config() {
  Config config;
  config.platform = test_platform();
  const char* lanes = std::getenv("FRONTIER_SURFELS_TEST_LANES");
  if (lanes != nullptr) set_field(config, "lanes", lanes);
  return config;
}

/// With FRONTIER_SURFELS_TEST_GROUPS, work items have a pixel or a surfel together, as on a graphics processor: also on a CPU, which gains
/// nothing by it.
inline Device test_device() {
  Device device = choose_device(test_config());
  if (std::getenv("FRONTIER_SURFELS_TEST_GROUPS") != nullptr) device.has_teams = true;
  return device;
}

/// Built once per program, because compiling the kernels takes longer than most tests. Never destroyed, because a driver may be unloaded
/// earlier.
inline Commands& test_commands() {
  static auto* const commands = new Commands(test_device());
  return *commands;
}

/// Whether a device can be limited to some of its compute units. Tests of threads are skipped only if it cannot: any other error of a
/// device is a fault.
inline bool can_be_divided(const Device& device) {
  const auto parts = device.device.getInfo<CL_DEVICE_PARTITION_PROPERTIES>();
  return std::find(parts.begin(), parts.end(), CL_DEVICE_PARTITION_BY_COUNTS) != parts.end();
}

/// Number of OpenCL devices of all platforms.
inline std::size_t number_of_devices() {
  std::vector<cl::Platform> platforms;
  cl::Platform::get(&platforms);
  std::size_t count = 0;
  for (const cl::Platform& platform : platforms) {
    cl_uint devices = 0;
    if (clGetDeviceIDs(platform(), CL_DEVICE_TYPE_ALL, 0, nullptr, &devices) == CL_SUCCESS) count += devices;
  }
  return count;
}

/// The same device limited to one thread; null if it cannot be limited.
inline std::unique_ptr<Commands> one_thread_commands() {
  if (!can_be_divided(test_commands().device())) return nullptr;
  Config one = test_config();
  one.threads = 1;
  return std::make_unique<Commands>(choose_device(one));
}

}  // namespace frontier_surfels
