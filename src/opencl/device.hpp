/// Choice of the OpenCL device.
#pragma once

#include "frontier_surfels/config.hpp"
#include "opencl/opencl.hpp"

namespace frontier_surfels {

struct Device {
  cl::Device device;
  cl::Context context;
  bool is_cpu = false;
  int lanes = 1;               ///< points that one work item handles at once: 16 or 1
  bool long_loops = false;     ///< one work item may do all of a small piece of work: llvmpipe ends loops after 65535 turns
  bool shares_memory = false;  ///< with the host
  std::string description;     ///< platform, name and compute units
};

/// The device that platform, device_type, device_index and threads ask for, and how many lanes its work items have.
/// @throws DeviceError with a list of all devices if there is none, or if it lacks what the kernels need
Device choose_device(const Config& config);

}  // namespace frontier_surfels
