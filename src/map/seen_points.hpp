/// Seen points, our addition to the paper: memory of what forgotten views have seen. kernels/common/seen_points.cl describes
/// the buffers: blocks of the map have tables of bricks, and bricks have a bit for each point of the lattice.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/shared.h"
#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"
#include "map/block_map.hpp"
#include "map/map_window.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

constexpr double kSeenSpacing = 2.5;  ///< distance of the points [edge of a voxel]

/// Distance of the points, unless a parameter says otherwise [m]: by the voxels at z_min, or at a sixth of z_max if that is farther. By
/// very near voxels, which are small, the points would need more memory and time than the map.
inline double default_seen_spacing(const Grid& grid) {
  return kSeenSpacing * grid.delta_min * std::max(1.0F, grid.z_max / (6 * grid.z_min));
}

/// What is remembered of a block, as SeenPoints::read_blocks() gives it.
using SeenBlock = StoredBlock;

/// If the device fails in a call, what is remembered is as before, with two exceptions: bricks that add_brick() has given stay, and
/// forget() may have forgotten a part of what it was to forget.
class SeenPoints {
 public:
  /// @param block_size  edge of the map's blocks [m]
  SeenPoints(Commands& commands, double block_size);

  /// Chooses the lattice, unless choose_shift() has, or something has been remembered: the distance of its points becomes a block's edge
  /// divided by a power of two, and at most `spacing` [m], but at least 1 / 256 of the edge.
  void choose_spacing(double spacing);
  void choose_shift(int shift);  ///< chooses the lattice of a saved map until clear(); nothing may be remembered

  /// Adds a sentence if choose_spacing(spacing) would change the lattice, but the map has it already. @param spacing  0: any will do
  void warn_of_spacing(double spacing, std::vector<std::string>* warnings) const;
  static int shift_for_spacing(double block_size, double spacing);
  double spacing() const;               ///< distance of the lattice's points [m]
  int shift() const { return shift_; }  ///< log2 of the number of bricks along a block's edge
  bool empty() const { return table_of_.table().empty(); }

  /// Sends the tables of a window's blocks, for questions about points in it, and what send_entries() has not sent yet.
  void open_window(const MapWindow& window);

  /// Number of the table of a cell of the window that was opened last, if no block was dropped since; 0: it has none.
  int window_table(int cell) const { return (*window_tables_)[cell]; }

  /// Number of a block's table; made if the block has none.
  int table(const BlockKey& block);
  cl_int entry(int table, int brick) const { return tables_[at(table, brick)]; }
  std::vector<int> bricks_with_points(int table) const;  ///< those of a block of which any point is seen
  bool has_points(int table) const;                      ///< is there one?
  int bricks_of_block() const { return 1 << (3 * shift_); }
  bool is_full(int table) const { return full_bricks_[table] == bricks_of_block(); }  ///< are all points of the block seen?

  /// @name Changes of entries. They reach the device with send_entries().
  /// @{
  cl_int add_brick(int table, int brick);  ///< a brick of its own, without seen points, for a place that has none. @return its number
  cl_int own_brick(int table, int brick);  ///< gives the brick words of its own, if it has none, with the points it has. @return its number
  void set_uniform(int table, int brick, bool seen);  ///< all points of the brick are seen, or none; a brick of its own becomes free
  void send_entries(const char* stage);
  /// @}

  /// @name Whole blocks, for files and for the archive: bytes as in seen_block.hpp
  /// @{
  std::vector<BlockKey> blocks() const;              ///< with a table, even if none of their points is seen; sorted
  std::vector<BlockKey> blocks_with_points() const;  ///< sorted
  std::vector<std::vector<std::uint8_t>> read_blocks(const std::vector<BlockKey>& blocks);

  /// Puts blocks with these bytes in place of what is remembered of them. @throws FileError  the bytes are those of another lattice, or
  /// damaged
  void add_blocks(const std::vector<SeenBlock>& blocks);
  void drop_block(const BlockKey& block);

  SeenSpace saved();  ///< all blocks

  /// @throws FileError  add_blocks() would refuse a block of it, or the lattice
  static void check(const SeenSpace& seen);
  void load(const SeenSpace& seen);  ///< into an empty memory
  /// @}

  /// Forgets the points in a box of the world [m]. With an archive, MapArchive::forget() does it.
  void forget(const Eigen::AlignedBox3d& box);

  void clear();

  std::size_t bytes() const;                                       ///< memory on the device and the host
  std::size_t bricks() const { return used_ - free_.size() - 2; }  ///< with points that are seen and points that are not

  /// Work items of the kernels that handle a cube of words each (SEE_CUBES), for so many bricks.
  std::size_t cubes(std::size_t bricks) const { return bricks * (commands_.lanes() == 1 ? SEEN_WORDS : SEEN_WORDS / 8); }

  const cl::Buffer& slots() const { return slots_(); }
  const cl::Buffer& tables() const { return tables_on_device_(); }
  const cl::Buffer& brick_words() const { return bricks_(); }

 private:
  static constexpr int kMostShift = 4;  ///< 16 bricks, hence 256 points, along a block's edge: a block's table takes 16 kB
  static constexpr std::size_t kGroup = 64;

  std::size_t at(int table, int brick) const { return (static_cast<std::size_t>(table) << (3 * shift_)) + brick; }
  /// A brick of which some points are forgotten: first, and one past the last along each axis.
  struct PartlyForgotten {
    int table, brick;
    cl_int number;  ///< of its own brick, be it a new one
    bool was_full;  ///< all its points were seen: the brick is new
    Eigen::Array3i first, last;
  };
  std::vector<PartlyForgotten> bricks_in(const Eigen::AlignedBox3d& box, std::vector<std::pair<int, int>>& whole) const;
  std::vector<cl_uchar> forget_points(const std::vector<PartlyForgotten>& partly);
  cl_int take_brick();
  std::vector<cl_int> take_bricks(std::size_t count);
  void give_back(const std::vector<cl_int>& bricks) { free_.insert(free_.end(), bricks.rbegin(), bricks.rend()); }
  void scatter(std::vector<cl_int> numbers, const std::vector<cl_ulong>& words);
  void set_entry(int table, int brick, cl_int value);
  template <typename Visitor>
  void for_each_word(int table, Visitor visitor) const;

  Commands& commands_;
  const double block_size_;  ///< [m]
  int shift_ = 2;
  bool fixed_ = false;  ///< by choose_shift(), or because something has been remembered
  BlockMap<int> table_of_;
  std::vector<cl_int> tables_;                                ///< the device's tables; the host is their master
  std::vector<int> full_bricks_;                              ///< of each table: number of entries that are SEEN_BRICK_FULL
  std::vector<std::uint64_t> not_empty_;                      ///< a bit for each entry: is it not SEEN_BRICK_EMPTY?
  std::vector<int> free_tables_;                              ///< of blocks that were dropped; the last one is used next
  std::vector<cl_int> free_;                                  ///< bricks that no entry has; the last one is used next
  std::size_t used_ = 2;                                      ///< one past the last brick ever used; the first two stand for uniform bricks
  std::size_t sent_tables_ = 0;                               ///< entries that the device has
  std::vector<cl_int> changed_places_;                        ///< entries of the tables that the device does not have yet, each once
  std::vector<bool> is_changed_;                              ///< of each entry: is it one of them?
  std::vector<cl_int> new_bricks_;                            ///< bricks that the device has not emptied yet
  std::shared_ptr<const std::vector<cl_int>> window_tables_;  ///< of each cell of the window that was opened last
  SentArray<cl_int> slots_;                                   ///< the same
  SentArray<cl_int2> entries_;
  SentArray<cl_int> new_bricks_list_;
  DeviceArray<cl_int> tables_on_device_;
  DeviceArray<cl_ulong> bricks_;
  DeviceArray<cl_ulong> gathered_;
  SentArray<cl_int> gathered_list_;
};

}  // namespace frontier_surfels
