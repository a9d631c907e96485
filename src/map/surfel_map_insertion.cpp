/// How surfels get into the map, and how a frame ends: before or after the host knows what the frame has found.
#include <algorithm>

#include "common/shared.h"
#include "map/surfel_map.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kLeastKept = 1 << 16;  // surfels that a frame which goes ahead may overwrite

}  // namespace

void SurfelMap::reserve(std::size_t additional) {
  const std::size_t blocks = std::min<std::size_t>(additional, window_.cells());
  grow(index_.end() + additional / PAGE_SLOTS + blocks);
}

void SurfelMap::insert(const char* stage, const DeviceArray<cl_uint4>& surfels, const DeviceArray<cl_uint>& cells, std::size_t count) {
  if (count == 0) return;
  spare_pages_.clear();                               // this frame's changes are not carried out ahead any more
  if (sorted_pages_ < window_pages()) list_window();  // an earlier insertion has added pages, which are not sorted by cell yet
  new_count_.resize(1);
  new_count_.fill(stage, static_cast<cl_uint>(count), 1);
  nothing_.resize(window_pages() + 1);
  nothing_.fill(stage, 0, window_pages() + 1);
  missing_told_ = nullptr;
  sort(stage, {cells, new_count_(), count, count}, nothing_);
  insert_sorted(stage, surfels, count);
}

bool SurfelMap::sort_early(const char* stage, const NewCells& cells, const DeviceArray<cl_ulong>& leaving) {
  missing_told_ = nullptr;
  if (sorted_pages_ < window_pages()) return false;
  sort(stage, cells, leaving);
  missing_told_ = missing_before_.read_later(window_.cells() + 1);
  return true;
}

bool SurfelMap::go_ahead(const char* stage, const Doubts& doubts) {
  if (spare_pages_.empty() || missing_told_ == nullptr || undo_.kept_pages > 0) return false;
  if (!has_memory_for([&] { make_room_to_keep(undo_.most_kept + std::max(next_kept_, kLeastKept)); })) return false;
  const auto room = static_cast<cl_uint>(undo_.room - undo_.most_kept), spare = static_cast<cl_uint>(spare_pages_.size());
  const cl::Buffer& evidence = doubts.evidence != nullptr ? *doubts.evidence : doubts.listed;  // a kernel takes no missing buffer
  commands_.run(stage, "decide_to_go_on", 1, 1, evidence, static_cast<cl_int>(doubts.evidence != nullptr), doubts.listed, doubts.chosen,
                missing_before_(), static_cast<cl_uint>(window_.cells()), spare, room, doubts.counts);
  ahead_counts_ = doubts.counts;
  is_ahead_ = undo_.ahead = true;
  undo_.spares_from = window_pages();
  return true;
}

/// Too little memory for what a frame may not need is no fault.
bool SurfelMap::has_memory_for(const std::function<void()>& allocate) {
  try {
    allocate();
  } catch (const Error&) {
    return false;
  } catch (const AllocationError&) {
    return false;
  }
  return true;
}

void SurfelMap::went_on(std::size_t removed, std::size_t added) {
  is_ahead_ = false;
  undo_.most_kept += removed;
  add_missing_pages();  // there is room for them, and they have surfels already
  size_ += added;
  size_ -= removed;
}

void SurfelMap::stayed() {
  is_ahead_ = undo_.ahead = false;
  undo_.kept_pages = 0;
}

void SurfelMap::insert_sorted(const char* stage, const DeviceArray<cl_uint4>& surfels, std::size_t count) {
  if (count == 0) return;
  if (missing_told_ == nullptr) missing_told_ = std::make_shared<const std::vector<cl_uint>>(missing_before_.read(window_.cells() + 1));
  grow(index_.end() + missing_told_->back());
  add_missing_pages();
  spare_pages_.clear();
  if (sorted_pages_ < window_pages()) send_pages();
  size_ += count;
  insert_ahead(stage, surfels);
}

void SurfelMap::insert_ahead(const char* stage, const DeviceArray<cl_uint4>& surfels) {
  const std::size_t pages = pages_to_change(), items = pages * (commands_.shape().many_items ? PAGE_SLOTS : 1);
  commands_.run(stage, "fill_pages", items, PAGE_GROUP, goes_on(), window_.window(), pages_list_(), page_cells_list_(),
                static_cast<cl_uint>(pages), static_cast<cl_uint>(sorted_pages_), missing_before_(), cell_begin_(), cell_pages_list_(),
                free_before_(), order_(), surfels(), page_block_(), alive_(), changed_(), reserved(), surfels_());
}

/// Appends the pages to the window that its blocks need for the surfels that were sorted, once the host knows their number. They are the
/// first of spare_pages_, in this order.
void SurfelMap::add_missing_pages() {
  const std::vector<cl_uint>& before = *missing_told_;
  next_spares_ = 2 * before.back();
  for (std::size_t cell = 0; cell + 1 < before.size(); ++cell) {
    if (before[cell] == before[cell + 1]) continue;
    const BlockKey block = window_.block(static_cast<int>(cell));
    for (cl_uint n = before[cell]; n < before[cell + 1]; ++n) {
      window_pages_.push_back(add_page(block));
      page_cells_.push_back(static_cast<cl_uint>(cell));
    }
    listed_[cell] = index_.find(block);
  }
}

void SurfelMap::sort(const char* stage, const NewCells& cells, const DeviceArray<cl_ulong>& leaving) {
  const auto cell_count = static_cast<cl_uint>(window_.cells()), pages = static_cast<cl_uint>(window_pages());
  free_before_.resize(pages + 1);
  cell_begin_.resize(cell_count + 1);
  missing_before_.resize(cell_count + 1);
  order_.resize(cells.room);
  const std::size_t alone = commands_.shape().sort_alone;
  if (alone == 0 || cells.expected > alone) return sort_by_cell(stage, cells, leaving);
  commands_.run(stage, "sort_few", 1, 1, cells.cells(), cells.length, pages_list_(), pages, leaving(), alive_(),
                static_cast<cl_int>(reserves_ids_), reserved(), cell_pages_list_(), cell_count, free_before_(), cell_begin_(),
                missing_before_(), order_());
}

void SurfelMap::sort_by_cell(const char* stage, const NewCells& cells, const DeviceArray<cl_ulong>& leaving) {
  const auto cell_count = static_cast<cl_uint>(window_.cells()), pages = static_cast<cl_uint>(window_pages());
  const auto chunks = static_cast<cl_uint>(commands_.shape().sort_chunks(cell_count));
  const std::size_t bins = std::size_t{chunks} * cell_count, group = commands_.shape().sort_group;
  histogram_.resize(bins + 1);
  histogram_.fill(stage, 0, bins);
  commands_.run(stage, "count_cells", chunks * group, group, cells.cells(), cells.length, chunks, histogram_());
  lists_.prefix_sums(stage, histogram_, bins);
  if (pages == 0) free_before_.fill(stage, 0, 1);
  commands_.run(stage, "count_free", pages, kGroup, pages_list_(), pages, leaving(), alive_(), static_cast<cl_int>(reserves_ids_),
                reserved(), free_before_());
  lists_.prefix_sums(stage, free_before_, pages);
  commands_.run(stage, "begin_cells", cell_count + 1, kGroup, histogram_(), cell_pages_list_(), free_before_(), cell_count, chunks,
                cell_begin_(), missing_before_());
  lists_.prefix_sums(stage, missing_before_, cell_count);
  commands_.run(stage, "sort_by_cell", chunks * group, group, cells.cells(), cells.length, chunks, histogram_(), order_());
}

void SurfelMap::finish_frame(const char* stage, std::uint32_t frame) {
  const auto count = static_cast<cl_uint>(pages_to_change());
  changed_words_.resize(count + 1);
  empty_.resize(count + 1);
  commands_.run(stage, "finish_pages", count, kGroup, goes_on(), pages_list_(), count, alive_(), changed_(), frame, page_block_(),
                changed_words_(), empty_());
  changed_words_told_ = changed_words_.read_later(logs_changes_ ? count : 0);
  empty_told_ = empty_.read_later(count);
}

}  // namespace frontier_surfels
