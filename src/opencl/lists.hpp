/// Prefix sums and lists of set bits on the device. The results do not depend on the number of threads.
#pragma once

#include <cstdint>

#include "opencl/commands.hpp"

namespace frontier_surfels {

class Lists {
 public:
  static constexpr std::uint32_t kMaxTotal = 0xfffffffeU;

  explicit Lists(Commands& commands);

  /// Replaces each value by the sum of all values before it. @param values  `count` values, and room for one more: the total
  void prefix_sums(const char* stage, DeviceArray<cl_uint>& values, std::size_t count) {
    if (count > 0) scan_level(stage, values, count, 0);
  }

  /// As prefix_sums(), and reads the total. @return the total
  /// @throws BadFrame  the total is more than kMaxTotal
  std::uint32_t scan(const char* stage, DeviceArray<cl_uint>& values, std::size_t count);

  /// Lists the set bits of `count` words, ascending, each as 64 * word + bit. @return number of set bits
  std::uint32_t list_bits(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, DeviceArray<cl_uint>& list);

 private:
  std::uint32_t list_few_bits(const char* stage, const DeviceArray<cl_ulong>& bits, cl_uint words, DeviceArray<cl_uint>& list);
  void scan_level(const char* stage, DeviceArray<cl_uint>& values, std::size_t count, std::size_t level);

  Commands& commands_;
  DeviceArray<cl_uint> counts_;
  DeviceArray<cl_uint> levels_[5];  ///< sums of chunks, sums of chunks of these, and so on
};

}  // namespace frontier_surfels
