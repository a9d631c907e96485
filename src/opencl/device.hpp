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
  bool prefers_one_item = false;  ///< one work item does small jobs alone, because a launch costs more on PoCL; not on llvmpipe, which
                                  ///< ends loops after 65535 turns
  bool shares_memory = false;     ///< the device works in the host's memory
  bool keeps_programs =
      false;  ///< built kernels are kept as files; not on PoCL: it has a cache of its own, and giving out its binary took it over 40 s
  std::string description;  ///< platform, name and compute units
  std::string choice;       ///< why this device was taken, for display

  /// Group size for kernels with much work per item. 1 on a CPU: it runs the items of a group one after the other on one core.
  std::size_t heavy_group() const { return is_cpu ? 1 : 64; }
};

/// Chooses the device by platform, device_type, device_index and threads of the configuration, see device_ranking.hpp, and the lanes of its
/// work items.
/// @throws DeviceError  no device fits (the message lists all devices), or the device lacks something that the kernels need
Device choose_device(const Config& config);

}  // namespace frontier_surfels
