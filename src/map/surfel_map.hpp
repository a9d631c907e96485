/// The map in device buffers: the world has blocks, a block has pages, a page has PAGE_SLOTS slots for surfels. A surfel's slot is its id.
/// While someone follows the changes, slots of removed surfels that these readers know are reserved until they know of the removal.
/// kernels/common/surfels.cl describes the buffers.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"
#include "map/block_index.hpp"
#include "map/block_key.hpp"
#include "map/change_log.hpp"
#include "map/map_window.hpp"
#include "map/surfel_packing.hpp"
#include "opencl/commands.hpp"
#include "opencl/lists.hpp"

namespace frontier_surfels {

class SurfelMap {
 public:
  SurfelMap(Commands& commands, Lists& lists, const Config& config);

  std::size_t size() const { return size_; }
  double largest_radius() const { return largest_radius_; }  ///< no surfel is larger [m]
  std::size_t bytes() const;                                 ///< memory of the surfels and of their index, on the device and on the host
  std::size_t untouched_bytes() const;  ///< part of the buffers on a CPU that the operating system has not backed with memory yet

  /// @name A frame. Kernels work on the pages of the window. They clear the bits of removed surfels in `alive`, and set those of removed,
  /// new and changed ones in `changed`.
  /// @{

  /// Opens the window of a view: the blocks whose surfels may be in view.
  void open_window(const Grid& grid, const Eigen::Isometry3d& T_world_camera);

  const MapWindow& window() const { return window_; }
  std::size_t window_pages() const { return window_pages_.size(); }
  const cl::Buffer& pages() const { return pages_list_(); }

  /// Has the host called go_ahead(), and not been told yet what came of it?
  bool is_ahead() const { return is_ahead_; }

  /// Pages in pages() that a frame's changes may touch: the window's, and after go_ahead() those behind them that the frame may add.
  std::size_t pages_to_change() const { return window_pages() + (is_ahead_ ? spare_pages_.size() : 0); }

  /// What the kernels ask that change the map: kernels/map/pages.cl, decide_to_go_on.
  const cl::Buffer& goes_on() const { return is_ahead_ ? ahead_counts_ : always_(); }

  /// Lists the pages of all blocks within a distance [m] of the window. @return number of pages
  std::size_t list_pages_near(double distance, DeviceArray<cl_uint>& list) const;

  /// Keeps what the frame may overwrite, so that roll_back() can undo the frame: surfels that are marked as changed, and those in `freed`.
  /// @param freed  surfels that are going to leave the map, a word for each page that the window had when it was opened
  /// @param count  number of surfels in `freed`; 0 after go_ahead(), which has made room
  void back_up(const char* stage, const DeviceArray<cl_ulong>& freed, std::size_t count);

  /// Makes room for `additional` more surfels in this window.
  void reserve(std::size_t additional);

  /// Puts surfels into the map, and waits for the device on the way. @param cells  each surfel's cell of the window
  void insert(const char* stage, const DeviceArray<cl_uint4>& surfels, const DeviceArray<cl_uint>& cells, std::size_t count);

  /// Surfels that the map is to get, while only the device knows their number.
  struct NewCells {
    const DeviceArray<cl_uint>& cells;  ///< each surfel's cell of the window
    const cl::Buffer& length;           ///< [1]: their number
    std::size_t room, expected;         ///< number that it cannot exceed, and about that which is to be expected
  };

  /// The first half of insert(), which does not change the map, ahead of a wait for the device: insert_sorted() then need not wait.
  /// @param leaving  surfels that will have left the map by then: a word for each page of the window
  /// @return false if insert() must be called, because the window has got pages in this frame; nothing was done
  bool sort_early(const char* stage, const NewCells& cells, const DeviceArray<cl_ulong>& leaving);

  /// The other half, after that wait. @param count  the number of the surfels that were sorted
  void insert_sorted(const char* stage, const DeviceArray<cl_uint4>& surfels, std::size_t count);

  /// What only the device knows, and what keeps a frame from going on before the host knows it, too.
  struct Doubts {
    const cl::Buffer* evidence;         ///< [1]: number of pixels that want to take space back; null: it does not matter
    const cl::Buffer &listed, &chosen;  ///< [2]: lengths of the lists of candidates
    const cl::Buffer& counts;           ///< [COUNTS] of SurfelVisit; gets COUNT_GOES_ON
  };

  /// After sort_early(): back_up(), insert_ahead(), finish_frame() and the stages between them may be called before the host has waited.
  /// The device decides whether they change anything, and went_on() or stayed() must be called after the wait.
  /// @return false if the host must wait first: on devices where that costs little, where the frame has changed the map already, or where
  ///         there is too little memory for what the frame might need; nothing was done
  bool go_ahead(const char* stage, const Doubts& doubts);

  /// The other half of sort_early(), after go_ahead().
  void insert_ahead(const char* stage, const DeviceArray<cl_uint4>& surfels);

  /// The device has carried out what was called after go_ahead(). @param removed, added  numbers of surfels
  void went_on(std::size_t removed, std::size_t added);

  /// It has not: the map is as it was before go_ahead().
  void stayed();

  /// Counts surfels that a kernel has marked as changed; back_up() makes room for them.
  void marked(std::size_t count) { undo_.most_kept += count; }

  /// Subtracts surfels that a kernel has removed from size().
  void removed(std::size_t count) { size_ -= count; }

  /// Marks the pages that changed as changed in this frame, and finds those that it has left empty. The frame can still fail. Does not wait
  /// for the device.
  void finish_frame(const char* stage, std::uint32_t frame);

  /// Ends the frame for good, once the host has waited after finish_frame(): frees the empty pages. @return block of each freed page
  std::vector<BlockKey> commit(std::uint32_t frame);

  /// Undoes what a failed frame, or a failed add_block() or drop_block(), has done since the last commit(). Nothing else can be done with
  /// the map before this has succeeded. Does nothing if nothing has failed.
  /// @throws DeviceError  the device fails again (call it again later), or it has failed in replace() and the map is lost
  void roll_back();
  /// @}

  /// All surfels, ordered by slot.
  std::vector<Surfel> download() const;

  /// What has changed after the map `since`, as far as ChangeLog knows; ordered by slot.
  Changes changes(std::uint64_t since) const;

  /// All surfels as updated, all empty slots as removed.
  Changes whole() const;

  /// From now on, changes are logged for these readers. To be called between frames, whenever a reader has been told of this map.
  /// @param readers  the maps that they have, ascending; none: nothing is logged, as at first. @param now  number of this map
  void log_changes(const std::vector<std::uint64_t>& readers, std::uint64_t now);

  /// The same as log_changes(); in addition, no id of a surfel that is in one of the readers' maps is given again. Without readers, ids are
  /// given again at once, as at first.
  void reserve_ids(const std::vector<std::uint64_t>& readers, std::uint64_t now);

  /// @throws Error  replace() would refuse one of the surfels
  static void check(const std::vector<Surfel>& surfels);

  /// Replaces the whole map in frame `frame`. A block's surfels fill its pages in their given order. If the device fails meanwhile, the map
  /// is lost until it is replaced again. @return slot of each surfel
  std::vector<std::uint32_t> replace(const std::vector<Surfel>& surfels, std::uint32_t frame);

  /// Says that the map is lost, until replace() or set_lost(false): what belongs to it is being replaced.
  void set_lost(bool lost) { undo_.lost = lost; }

  /// @name Whole blocks, for the archive. Called between frames; adding or dropping a block closes the last frame's window.
  /// @{
  double block_size() const { return block_size_; }  ///< [m]

  /// Largest distance along any axis between the camera and the centre of a block of its window [m]; true also after the camera has moved
  /// by half a block.
  /// @throws BadFrame  the grid is far too large for its range
  double window_reach(const Grid& grid, const Eigen::Isometry3d& T_world_camera) const;

  const BlockIndex& index() const { return index_; }
  std::vector<BlockKey> blocks_changed_since(std::uint32_t frame) const;  ///< sorted
  ListedPages list_pages(std::vector<std::uint32_t> pages) const;         ///< in the order given
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

  /// What roll_back() needs.
  struct Undo {
    bool open = false;                                 ///< something may have to be undone
    bool lost = false;                                 ///< replace() has begun
    bool ahead = false;                                ///< go_ahead() was called: the device knows whether there is something to undo
    std::size_t spares_from = 0;                       ///< where spare_pages_ begin in pages_list_
    double largest_radius = 0;                         ///< [m]
    std::size_t size = 0, end = 0;                     ///< of the map, of the index
    std::vector<std::pair<BlockKey, Page>> new_pages;  ///< in the order in which the index got them
    std::vector<std::pair<Page, cl_ulong>> dropped;    ///< pages of a dropped block, with their words of `alive`
    std::size_t kept_pages = 0;                        ///< pages of which back_up() has kept something
    std::size_t most_kept = 0, room = 0;               ///< surfels that back_up() may have to keep, and for which it has made room
  };

  void visit(const std::vector<Page>& pages, const PageVisitor& visitor) const;
  Changes changes(const ChangeLog::Difference& difference) const;
  void read_surfels(const ListedPages& pages, const std::vector<cl_uint>& entries, std::vector<Surfel>& to) const;
  void begin_undo();
  void restore();
  Page add_page(const BlockKey& block);
  void grow(std::size_t pages);
  double window_margin(const Grid& grid) const;
  void list_window();
  void choose_spare_pages();
  void send_pages();
  void close_window();
  void add_missing_pages();
  std::size_t allocated_bytes() const;
  const cl::Buffer& reserved() const { return reserves_ids_ ? reserved_() : alive_(); }   ///< no new surfel may take these slots
  std::uint32_t removal(std::uint32_t frame) const { return reserves_ids_ ? frame : 0; }  ///< for index_: pages removed in a frame
  void make_room_to_keep(std::size_t surfels);
  static bool has_memory_for(const std::function<void()>& allocate);
  void sort(const char* stage, const NewCells& cells, const DeviceArray<cl_ulong>& leaving);
  void sort_by_cell(const char* stage, const NewCells& cells, const DeviceArray<cl_ulong>& leaving);
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
  DeviceArray<cl_ulong> reserved_;  ///< those whose surfels a reader knows, alive or not. Only with reserves_ids_
  DeviceArray<cl_int4> page_block_;

  // This frame's window: its pages, sorted by cell, and then those that the frame has added
  MapWindow window_;
  std::vector<Page> window_pages_;
  std::vector<cl_uint> page_cells_;  ///< cell of each page
  /// Of each cell, its block's pages, if they are listed: the block meets the grid, or got pages in this frame. Else null
  std::vector<const BlockIndex::Pages*> listed_;
  std::size_t sorted_pages_ = 0;  ///< those before added ones
  /// The same on the device, where only the sorted ones have cells. cell_pages_list_: index of the first page of each cell, then the number
  /// of pages.
  SentArray<cl_uint> pages_list_, page_cells_list_, cell_pages_list_;

  // Insertion. missing_before_: of each cell, pages that the cells before it need in addition to those that they have
  DeviceArray<cl_uint> histogram_, cell_begin_, free_before_, missing_before_, order_, new_count_;
  DeviceArray<cl_ulong> nothing_;  ///< no surfel of any page of the window
  std::shared_ptr<const std::vector<cl_uint>> missing_told_;

  // Frames that go on before the host has waited
  DeviceArray<cl_uint> always_;    ///< [COUNTS] that say: go on. Kernels get them where the host has decided
  cl::Buffer ahead_counts_;        ///< Doubts::counts
  bool is_ahead_ = false;          ///< after go_ahead()
  std::vector<Page> spare_pages_;  ///< the next ones of the index, listed on the device behind the window's; none where no frame goes ahead
  std::size_t next_spares_ = 0;    ///< of the next frame
  std::size_t next_kept_ = 0;      ///< surfels of the next frame that there should be room to keep

  // What a failed frame has overwritten
  Undo undo_;
  DeviceArray<cl_uint> kept_pages_, kept_count_, kept_surfel_slots_;
  DeviceArray<cl_int> kept_frames_;
  DeviceArray<cl_ulong> kept_alive_, kept_slots_;
  DeviceArray<cl_uint4> kept_surfels_;

  // Changes
  DeviceArray<cl_ulong> changed_words_;                              ///< of this frame, one for each page of the window
  DeviceArray<cl_uchar> empty_;                                      ///< also for each page: 1 if the frame has left it empty
  std::shared_ptr<const std::vector<cl_ulong>> changed_words_told_;  ///< the same while changes are logged; else none
  std::shared_ptr<const std::vector<cl_uchar>> empty_told_;
  bool logs_changes_ = false;
  ChangeLog log_;
};

}  // namespace frontier_surfels
