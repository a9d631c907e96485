/// Prefix sums and lists of set bits on the device. The results do not depend on the number of threads.
#pragma once

#include <cstdint>

#include "opencl/commands.hpp"

namespace frontier_surfels {

/// A list of whose length the host does not wait to be told, where WorkShape says so: it has room for about twice the entries that it had
/// last. Kernels that go through it are launched for all its room, and find its length in length().
class DeviceList {
 public:
  explicit DeviceList(Commands& commands) : entries_(commands), length_(commands) {}

  const cl::Buffer& operator()() const { return entries_(); }
  const cl::Buffer& length() const { return length_(); }                ///< [2]: number of entries, and what it would be with more room
  std::size_t room() const { return room_; }                            ///< most entries that kernels have to look for
  std::vector<cl_uint> read() const { return entries_.read(count()); }  ///< waits for the device

  /// @name Its length, after the next command that waits for the device
  /// @{
  void read_length_later() {
    if (told_ == nullptr) told_ = length_.read_later(2);
  }
  std::size_t count() const { return told_ == nullptr ? 0 : told_->front(); }
  std::size_t total() const { return told_ == nullptr ? 0 : told_->back(); }  ///< what the length would be with more room
  bool is_whole() const { return total() <= room_; }

  /// The next time there is room for all of these.
  void note_length() { expect(total()); }
  /// @}

  void expect(std::size_t count) { next_room_ = std::max(2 * count, room_ / 2); }
  void expect_nothing() { next_room_ = 0; }

 private:
  friend class Lists;

  DeviceArray<cl_uint> entries_, length_;
  std::shared_ptr<const std::vector<cl_uint>> told_;
  std::size_t room_ = 0, next_room_ = 0;
};

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

  /// The same, without waiting for the device: as many as there is room for.
  void list_bits(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, DeviceList& list);

 private:
  std::uint32_t list_all(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, DeviceArray<cl_uint>& list,
                         DeviceArray<cl_uint>& length);
  void list_into(const char* stage, const DeviceArray<cl_ulong>& bits, std::size_t count, const DeviceArray<cl_uint>& list,
                 std::size_t room, const DeviceArray<cl_uint>& length);
  void scan_level(const char* stage, DeviceArray<cl_uint>& values, std::size_t count, std::size_t level);

  Commands& commands_;
  DeviceArray<cl_uint> counts_, length_;
  DeviceArray<cl_uint> levels_[5];  ///< sums of chunks, sums of chunks of these, and so on
};

}  // namespace frontier_surfels
