/// The map in device buffers: the world has blocks, a block has pages, a page has PAGE_SLOTS slots for surfels. A surfel's slot is its id.
/// While someone follows the changes, slots of removed surfels are reserved until these readers know of the removal.
/// kernels/common/surfels.cl describes the buffers.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
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
  std::size_t bytes() const;            ///< memory of the surfels and of their index, on the device and on the host
  std::size_t untouched_bytes() const;  ///< part of the buffers on a CPU that the operating system has not backed with memory yet

  /// @name A frame. Kernels work on the pages of the window. They clear the bits of removed surfels in `alive`, and set those of removed,
  /// new and changed ones in `changed`.
  /// @{

  /// Opens the window of a view: the blocks whose surfels may be in view.
  void open_window(const Grid& grid, const Eigen::Isometry3d& T_world_camera);

  const MapWindow& window() const { return window_; }
  std::size_t window_pages() const { return window_pages_.size(); }
  const cl::Buffer& pages() const { return pages_list_(); }

  /// Lists the pages of all blocks within a distance [m] of the window. @return number of pages
  std::size_t list_pages_near(double distance, DeviceArray<cl_uint>& list) const;

  /// Makes room for `additional` more surfels in this window.
  void reserve(std::size_t additional);

  /// Puts surfels into the map. @param cells  each surfel's cell of the window
  void insert(const char* stage, const DeviceArray<cl_uint4>& surfels, const DeviceArray<cl_uint>& cells, std::size_t count);

  /// Subtracts surfels that a kernel has removed from size().
  void removed(std::size_t count) { size_ -= count; }

  /// Marks the pages that changed as changed in this frame, and frees the empty ones. @return block of each freed page
  std::vector<BlockKey> finish_frame(const char* stage, std::uint32_t frame);

  /// Changes of the last frame; available until the next one begins.
  Changes last_changes();
  /// @}

  /// All surfels, ordered by slot.
  std::vector<Surfel> download() const;

  /// Content of the pages that changed after frame `since`: all their surfels as updated, all their empty slots as removed.
  /// @param given_again  ids may have been given again after `since`: all slots of these pages are told as removed
  Changes changes(std::uint64_t since, bool given_again = false) const;

  /// From now on, no id is given again that a surfel has lost after frame `told`. To be called between frames. Without a number, ids are
  /// given again at once, as at first.
  void reserve_ids(std::optional<std::uint64_t> told);

  /// Replaces the whole map in frame `frame`. A block's surfels fill its pages in their given order. @return slot of each surfel
  std::vector<std::uint32_t> replace(const std::vector<Surfel>& surfels, std::uint32_t frame);

  /// @name Whole blocks, for the archive. Called between frames; adding or dropping a block closes the last frame's window.
  /// @{
  double block_size() const { return block_size_; }  ///< [m]

  /// Largest distance along any axis between the camera and the centre of a block of its window [m]; true also after the camera has moved
  /// by half a block.
  /// @throws BadFrame  the grid is far too large for its range
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
  const cl::Buffer& taken() const { return reserves_ids_ ? reserved_() : alive_(); }      ///< slots that no new surfel may take
  std::uint32_t removal(std::uint32_t frame) const { return reserves_ids_ ? frame : 0; }  ///< for index_: pages removed in a frame
  void sort_by_cell(const char* stage, const DeviceArray<cl_uint>& cells, cl_uint count, cl_uint cell_count);
  Surfel to_surfel(const cl_uint4& packed, const cl_int4& block, std::uint32_t slot) const;

  Commands& commands_;
  Lists& lists_;
  const double block_size_;  ///< [m]
  double largest_radius_;    ///< no surfel of the map is larger [m]
  const double thickness_;   ///< [voxel]
  std::size_t size_ = 0;
  bool reserves_ids_ = false;
  BlockIndex index_;

  // Indexed by slot or page
  DeviceArray<cl_uint4> surfels_;
  DeviceArray<cl_ulong> alive_, changed_;
  DeviceArray<cl_ulong> reserved_;  ///< alive ones, and those whose removal has not been told. Only with reserves_ids_
  DeviceArray<cl_int4> page_block_;

  // This frame's window: its pages, sorted by cell
  MapWindow window_;
  std::vector<Page> window_pages_;
  std::vector<cl_uint> page_cells_;  ///< cell of each page
  std::vector<bool> listed_cells_;   ///< cells with listed pages: their block meets the grid, or got pages in this frame
  std::vector<cl_uint> new_ranks_;   ///< rank of each added page within its cell; insert() appends added pages behind the sorted ones
  /// The same on the device. cell_pages_list_: index of the first page of each cell, then the number of pages.
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
