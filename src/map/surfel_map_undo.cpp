/// What makes a frame all or nothing: a backup of what it overwrites, its end, which cannot fail, and the way back.
#include <algorithm>

#include "common/shared.h"
#include "map/surfel_map.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kSpare = 32;  // buffers of kept surfels get 1 / kSpare more room than needed

}  // namespace

void SurfelMap::begin_undo() {
  undo_ = {};
  undo_.open = true;
  undo_.largest_radius = largest_radius_;
  undo_.size = size_;
  undo_.end = index_.end();
  is_ahead_ = false;
  spare_pages_.clear();
  missing_told_ = nullptr;
}

/// Adds a page to a block of the index.
SurfelMap::Page SurfelMap::add_page(const BlockKey& block) {
  const Page page = index_.add_page(block);
  undo_.new_pages.emplace_back(block, page);
  return page;
}

void SurfelMap::back_up(const char* stage, const DeviceArray<cl_ulong>& freed, std::size_t freed_count) {
  const bool first = undo_.kept_pages == 0;
  const std::size_t count = first ? window_pages() : undo_.kept_pages;  // pages that the frame has added need no backup
  if (count == 0) return;
  kept_pages_.resize(count);
  kept_frames_.resize(count);
  kept_alive_.resize(count);
  kept_slots_.resize(count);
  undo_.most_kept += freed_count;
  make_room_to_keep(undo_.most_kept);
  if (first) {
    kept_count_.resize(1);
    kept_count_.fill(stage, 0, 1);
  }
  const std::size_t items = count * (commands_.shape().many_items ? PAGE_SLOTS : 1);
  commands_.run(stage, "back_up_pages", items, PAGE_GROUP, goes_on(), pages_list_(), static_cast<cl_uint>(count),
                static_cast<cl_int>(first), freed(), page_block_(), alive_(), changed_(), surfels_(), static_cast<cl_uint>(undo_.room),
                kept_pages_(), kept_frames_(), kept_alive_(), kept_slots_(), kept_count_(), kept_surfel_slots_(), kept_surfels_());
  undo_.kept_pages = count;
}

void SurfelMap::make_room_to_keep(std::size_t surfels) {
  if (surfels <= undo_.room && kept_surfel_slots_.size() > 0) return;  // the one that is enlarged last
  kept_surfels_.grow(surfels + 1, undo_.room, kSpare);
  kept_surfel_slots_.grow(surfels + 1, undo_.room, kSpare);
  undo_.room = surfels;
}

std::vector<BlockKey> SurfelMap::commit(std::uint32_t frame) {
  const std::size_t pages = window_pages();
  if (logs_changes_)  // memory may run out: while the frame can still be undone
    log_.note(frame, window_pages_, *changed_words_told_);
  next_kept_ = 2 * undo_.most_kept;
  undo_ = {};
  std::vector<BlockKey> shrunk;
  const auto is_empty = [&](std::size_t n) { return (*empty_told_)[n] != 0; };
  for (std::size_t n = 0; n < pages; ++n) {
    if (!is_empty(n)) continue;
    const cl_uint cell = page_cells_[n];
    BlockIndex::Pages removed = {window_pages_[n]};  // a block's pages lie together, but for new ones
    for (; n + 1 < pages && page_cells_[n + 1] == cell; ++n)
      if (is_empty(n + 1)) removed.push_back(window_pages_[n + 1]);
    shrunk.push_back(window_.block(static_cast<int>(cell)));
    index_.remove_pages(shrunk.back(), removed, removal(frame));
  }
  return shrunk;
}

void SurfelMap::roll_back() {
  if (undo_.lost) throw DeviceError("The device has failed while the map was replaced, and the map is lost: load it again, or reset it.");
  if (!undo_.open) return;
  close_window();
  size_ = undo_.size;
  largest_radius_ = undo_.largest_radius;
  try {
    restore();
  } catch (const cl::Error& error) {
    throw DeviceError("A frame has failed half way, and the map cannot be restored because the device fails again with " +
                      opencl_error_name(error.err()) +
                      ". The next call tries once more; if it fails as well, load the map again, or reset it.");
  }
  for (; !undo_.new_pages.empty(); undo_.new_pages.pop_back()) {
    const auto& [block, page] = undo_.new_pages.back();
    index_.take_back(block, page, undo_.end);
  }
  undo_ = {};
  is_ahead_ = false;
  spare_pages_.clear();
}

/// The part of roll_back() that needs the device.
void SurfelMap::restore() {
  const char* stage = "roll_back";
  changed_.fill(stage, 0, changed_.size());
  const auto count = static_cast<cl_uint>(undo_.kept_pages);
  if (count > 0) {
    commands_.run(stage, "restore_pages", count, kGroup, undo_.ahead ? ahead_counts_ : always_(), kept_pages_(), count, kept_frames_(),
                  kept_alive_(), page_block_(), alive_());
    const cl_uint kept = std::min(kept_count_.read_one(0), static_cast<cl_uint>(undo_.room));
    if (kept > 0) commands_.run(stage, "restore_surfels", kept, kGroup, kept, kept_surfel_slots_(), kept_surfels_(), surfels_());
  }
  for (const auto& [page, alive] : undo_.dropped) alive_.write({alive}, page);
  if (undo_.ahead) {  // the pages that the frame has added are among these
    const auto spares = static_cast<cl_uint>(spare_pages_.size());
    commands_.run(stage, "clear_pages", spares, kGroup, pages_list_(), static_cast<cl_uint>(undo_.spares_from), spares, alive_());
  } else {
    for (const auto& [block, page] : undo_.new_pages) alive_.write({0}, page);
  }
  commands_.wait();  // nothing of the failed frame may still run when its values go
  commands_.forget_times();
}

}  // namespace frontier_surfels
