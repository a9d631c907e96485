/// Choice of the OpenCL device.
#pragma once

#include "frontier_surfels/config.hpp"
#include "opencl/opencl.hpp"

namespace frontier_surfels {

struct Device {
  cl::Device device;
  cl::Context context;
  bool is_cpu = false;
  int lanes = 1;                  ///< points that one work item handles at once: 16 or 1
  bool prefers_one_item = false;  ///< a small job is done by one work item alone: PoCL takes longer for a launch; llvmpipe cannot, it ends
                                  ///< loops after 65535 turns
  bool shares_memory = false;     ///< with the host
  std::string description;        ///< platform, name and compute units

  /// Work items of a group where each has much to do: a CPU runs the items of a group one after the other, and waits for the last.
  std::size_t heavy_group() const { return is_cpu ? 1 : 64; }
};

/// The device that platform, device_type, device_index and threads ask for, and how many lanes its work items have.
/// @throws DeviceError with a list of all devices if there is none, or if it lacks what the kernels need
Device choose_device(const Config& config);

}  // namespace frontier_surfels
