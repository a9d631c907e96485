/// The map: world blocks of pages of surfels in device buffers (kernels/common/surfels.cl says how). A surfel's slot is its id.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"
#include "map/block_index.hpp"
#include "map/block_key.hpp"
#include "map/map_window.hpp"
#include "opencl/commands.hpp"
#include "opencl/lists.hpp"

namespace frontier_surfels {

class SurfelMap {
 public:
  SurfelMap(Commands& commands, Lists& lists, const Config& config);

  std::size_t size() const { return size_; }
  std::size_t bytes() const;            ///< of all that holds surfels, or says where they are, on the device and on the host
  std::size_t untouched_bytes() const;  ///< of buffers on a CPU, which the operating system has not given yet

  /// @name A frame. Kernels work on the pages of the window, and mark in `alive` and `changed` what they remove and change.
  /// @{

  /// Chooses the blocks that surfels of this view may be in.
  void open_window(const Grid& grid, const Eigen::Isometry3d& T_world_camera);

  const MapWindow& window() const { return window_; }
  std::size_t window_pages() const { return window_pages_.size(); }
  const cl::Buffer& pages() const { return pages_list_(); }

  /// Lists the pages within a distance [m] of the window, for compute_known_hull. @return how many
  std::size_t list_pages_near(double distance, DeviceArray<cl_uint>& list) const;

  /// Makes room for `additional` more surfels of this window.
  void reserve(std::size_t additional);

  /// Puts surfels into the map. @param cells  of the window, for each surfel
  void insert(const char* stage, const DeviceArray<cl_uint4>& surfels, const DeviceArray<cl_uint>& cells, std::size_t count);

  /// Accounts for surfels that a kernel has removed.
  void removed(std::size_t count) { size_ -= count; }

  /// Notes which pages the frame has changed, and frees empty ones. @return blocks that have lost some, or all
  std::vector<BlockKey> finish_frame(const char* stage, std::uint32_t frame);

  /// What the last frame has changed. Only until the next one begins.
  Changes last_changes();
  /// @}

  /// All surfels by slot.
  std::vector<Surfel> download() const;

  /// Surfels of all pages changed after frame `since`, changed or not, and slots there that hold none.
  Changes changes(std::uint64_t since) const;

  /// Replaces everything, as frame `frame`. Gives every block pages in the order in which its surfels come. @return slot of each surfel
  std::vector<std::uint32_t> replace(const std::vector<Surfel>& surfels, std::uint32_t frame);

  /// @name Whole blocks, for the archive: between frames. The last frame's window is closed when one comes or goes.
  /// @{
  double block_size() const { return block_size_; }  ///< [m]

  /// Largest distance along an axis between the camera, moved by half a block at most, and the centre of a block of its window [m].
  /// @throws BadFrame  the grid is absurdly large for its range
  double window_reach(const Grid& grid, const Eigen::Isometry3d& T_world_camera) const;

  const BlockIndex& index() const { return index_; }
  std::vector<BlockKey> blocks_changed_since(std::uint32_t frame) const;  ///< sorted
  std::vector<StoredBlock> read_blocks(const std::vector<BlockKey>& blocks) const;
  void add_block(const BlockKey& block, const std::vector<std::uint8_t>& bytes, std::uint32_t frame);
  void drop_block(const BlockKey& block, std::uint32_t frame);
  /// @}

  const cl::Buffer& surfels() const { return surfels_(); }
  const cl::Buffer& alive() const { return alive_(); }
  const cl::Buffer& page_block() const { return page_block_(); }
  const cl::Buffer& changed() const { return changed_(); }

 private:
  using Page = std::uint32_t;
  using PageVisitor = std::function<void(Page page, const cl_int4& block, cl_ulong alive, const cl_uint4* surfels)>;
  void visit(const std::vector<Page>& pages, const PageVisitor& visitor) const;
  void grow(std::size_t pages);
  double window_margin(const Grid& grid) const;
  void list_window();
  void set_window(std::vector<Page> pages, std::vector<cl_uint> page_cells, std::vector<cl_uint> new_ranks);
  void close_window();
  void add_pages(const std::vector<cl_uint>& missing);
  std::size_t allocated_bytes() const;
  void sort_by_cell(const char* stage, const DeviceArray<cl_uint>& cells, cl_uint count, cl_uint cell_count);
  Surfel to_surfel(const cl_uint4& packed, const cl_int4& block, std::uint32_t slot) const;

  Commands& commands_;
  Lists& lists_;
  const double block_size_;  ///< [m]
  double largest_radius_;    ///< of all surfels that have ever been in the map [m]
  const double thickness_;   ///< [voxel]
  std::size_t size_ = 0;
  BlockIndex index_;

  // By slot or page
  DeviceArray<cl_uint4> surfels_;
  DeviceArray<cl_ulong> alive_, changed_;
  DeviceArray<cl_int4> page_block_;

  // This frame's window: pages by cell
  MapWindow window_;
  std::vector<Page> window_pages_;
  std::vector<cl_uint> page_cells_;  ///< cell of each page
  std::vector<bool> listed_cells_;   ///< whose blocks have pages, and meet the grid or have got some in this frame
  std::vector<cl_uint> new_ranks_;   ///< of pages that insert() has added behind the others: the how many-th of its cell's each is
  /// The same for the kernels, and where each cell's pages begin, and where the last ends.
  SentArray<cl_uint> pages_list_, page_cells_list_, cell_pages_list_, new_ranks_list_;

  // Insertion
  DeviceArray<cl_uint> histogram_, cell_begin_, free_before_, missing_, order_;

  // Changes
  DeviceArray<cl_ulong> changes_;
  DeviceArray<cl_uchar> empty_;
  DeviceArray<cl_uint> changed_slots_;
  DeviceArray<cl_uint4> gathered_;
  DeviceArray<cl_int4> gathered_blocks_;
};

}  // namespace frontier_surfels
