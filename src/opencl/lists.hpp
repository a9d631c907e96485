/// Lists in a fixed order from bits and counts on the device, the same on any number of threads.
#pragma once

#include <cstdint>

#include "opencl/commands.hpp"

namespace frontier_surfels {

class Lists {
 public:
  explicit Lists(Commands& commands);

  /// Replaces values by the sums of all before them. @param values  `count` of them and room for one more: the total
  void prefix_sums(const char* stage, DeviceArray<cl_uint>& values, std::size_t count) {
    if (count > 0) scan_level(stage, values, count, 0);
  }

  /// The same. @return the total
  std::uint32_t scan(const char* stage, DeviceArray<cl_uint>& values, std::size_t count);

  /// The numbers 64 n + bit of set bits, ascending. @param count  words. @return how many
  std::uint32_t list_bits(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, DeviceArray<cl_uint>& list);

 private:
  std::uint32_t list_few_bits(const char* stage, const DeviceArray<cl_ulong>& bits, cl_uint words, DeviceArray<cl_uint>& list);
  void scan_level(const char* stage, DeviceArray<cl_uint>& values, std::size_t count, std::size_t level);

  Commands& commands_;
  std::size_t few_;  ///< so many values one work item scans alone
  DeviceArray<cl_uint> counts_;
  DeviceArray<cl_uint> levels_[5];  ///< sums of chunks, of chunks of chunks, ...
};

}  // namespace frontier_surfels
