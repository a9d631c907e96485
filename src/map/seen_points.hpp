/// Seen points, our addition to the paper: memory of what views that are no longer kept have seen. kernels/common/seen_points.cl describes
/// the buffers: blocks of the map have tables of bricks, and bricks have a bit for each point of the lattice.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "common/shared.h"
#include "map/block_key.hpp"
#include "map/map_window.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

class SeenPoints {
 public:
  /// @param block_size  edge of the map's blocks [m]
  SeenPoints(Commands& commands, double block_size);

  /// Chooses the lattice, if nothing is remembered yet: the distance of its points becomes a block's edge divided by a power of two, and at
  /// most `spacing` [m], unless that would be below 1 / 1024 of the edge.
  void choose_spacing(double spacing);
  double spacing() const;         ///< distance of the lattice's points [m]
  int shift() const { return shift_; }  ///< log2 of the number of bricks along a block's edge
  bool empty() const { return table_of_.empty(); }

  /// Sends the tables of a window's blocks, for questions about points in it.
  void open_window(const MapWindow& window);

  /// Number of a block's table; made if the block has none.
  int table(const BlockKey& block);
  cl_int entry(int table, int brick) const { return tables_[at(table, brick)]; }
  int bricks_of_block() const { return 1 << (3 * shift_); }
  bool is_full(int table) const { return full_bricks_[table] == bricks_of_block(); }  ///< are all points of the block seen?

  /// @name Changes of entries. They reach the device with send_entries().
  /// @{
  cl_int add_brick(int table, int brick);      ///< a brick of its own, without seen points, for a place that has none. @return its number
  void set_full(int table, int brick);  ///< all points of the brick are seen; its own brick, if it has one, becomes free
  void send_entries(const char* stage);
  /// @}

  void clear();

  std::size_t bytes() const;  ///< memory on the device and the host
  std::size_t blocks() const { return table_of_.size(); }
  std::size_t bricks() const { return used_ - free_.size() - 2; }  ///< with points that are seen and points that are not

  const cl::Buffer& slots() const { return slots_(); }
  const cl::Buffer& tables() const { return tables_on_device_(); }
  const cl::Buffer& brick_words() const { return bricks_(); }

 private:
  std::size_t at(int table, int brick) const { return (static_cast<std::size_t>(table) << (3 * shift_)) + brick; }
  void set_entry(int table, int brick, cl_int value);

  Commands& commands_;
  const double block_size_;  ///< [m]
  int shift_ = 2;
  std::unordered_map<BlockKey, int> table_of_;
  std::vector<cl_int> tables_;           ///< the device's tables; the host is their master
  std::vector<int> full_bricks_;         ///< of each table: number of entries that are SEEN_BRICK_FULL
  std::vector<cl_int> free_;             ///< bricks that no entry has; the last one is used next
  std::size_t used_ = 2;                 ///< one past the last brick ever used; the first two stand for uniform bricks
  std::size_t sent_tables_ = 0;          ///< entries that the device has
  std::vector<cl_int2> changed_entries_;  ///< place in the tables and new value
  SentArray<cl_int> slots_;
  SentArray<cl_int2> entries_;
  DeviceArray<cl_int> tables_on_device_;
  DeviceArray<cl_ulong> bricks_;
};

}  // namespace frontier_surfels
