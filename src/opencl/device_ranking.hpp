/// The order of OpenCL devices by speed, and which of them a configuration takes. Knows devices only by what they say of themselves.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"

namespace frontier_surfels {

constexpr const char* kPocl = "Portable Computing Language";  // name of its platform

/// What a device says of itself.
struct DeviceFacts {
  std::string platform, name, driver, version;
  std::string type;  ///< gpu, accelerator or cpu
  unsigned compute_units = 0, clock_mhz = 0;
  std::uint64_t global_bytes = 0, largest_buffer_bytes = 0, local_bytes = 0, group_items = 0;
  bool available = true, has_compiler = true, little_endian = true;
  std::string fault;  ///< anything else that keeps it from running the kernels, as a clause or sentence without its full stop; "": nothing
};

/// What the device lacks to run the kernels, as a clause, for instance "it has no compiler for OpenCL C"; "" if it is usable.
std::string lacking(const DeviceFacts& device);

/// Platform, name, type and compute units.
std::string describe(const DeviceFacts& device);

/// Indices of the devices in ranking order: usable ones before others; then graphics processors, accelerators, CPUs; among CPUs those of
/// PoCL first; then more compute units x clock; then the order given.
std::vector<std::size_t> ranking(const std::vector<DeviceFacts>& devices);

struct Choice {
  std::size_t index = 0;  ///< among the devices
  std::string why;        ///< for display, for instance "fastest usable of 2: a graphics processor"
};

/// The device that number device_index is, from 0 and in ranking order, among those that fit platform and device_type.
/// @throws DeviceError  there is no such device, or it is not usable
Choice choose(const std::vector<DeviceFacts>& devices, const Config& config);

/// A table for people of all devices, in ranking order, with what each lacks and which one the configuration takes; what to install if
/// there is none.
std::string listing(const std::vector<DeviceFacts>& devices, const Config& config);

}  // namespace frontier_surfels
