/// Choice of the OpenCL device.
#pragma once

#include "frontier_surfels/config.hpp"
#include "opencl/opencl.hpp"

namespace frontier_surfels {

struct Device {
  cl::Device device;
  cl::Context context;
  bool is_cpu = false;
  bool is_pocl = false;        ///< of other drivers' devices we keep the built kernels as files. PoCL has a cache of its own, which is as
                               ///< fast when warm; to fill ours takes it 45 s, because it compiles all kernels then, not only those used
  bool is_pocl_cpu = false;    ///< what WorkShape says of PoCL, which other drivers of CPUs do not share: they compile vectors of 16 for
                               ///< minutes, and barriers at once
  int lanes = 1;               ///< points that one work item handles at once: 16 or 1
  bool has_teams = false;      ///< work items share pixels and surfels (WorkShape::view_team): not on CPUs, but for tests
  bool shares_memory = false;  ///< the device works in the host's memory
  std::string description;     ///< platform, name and compute units
  std::string choice;          ///< why this device was taken, for display
};

/// Chooses the device by platform, device_type, device_index and threads of the configuration, see device_ranking.hpp, and the lanes of its
/// work items.
/// @throws DeviceError  no device fits (the message lists all devices), or the device lacks something that the kernels need
Device choose_device(const Config& config);

}  // namespace frontier_surfels
