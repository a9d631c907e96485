/// Work on whole blocks between frames: replacing all of them, and moving single ones to and from the archive.
#include <algorithm>
#include <utility>

#include "common/shared.h"
#include "map/bits.hpp"
#include "map/surfel_map.hpp"
#include "map/surfel_packing.hpp"

namespace frontier_surfels {
namespace {

constexpr float kFarthest = 1e6F;     // [m]; block numbers have 32 bits, and floats are far coarser than the map there
constexpr double kLargestRadius = 4;  // [block]; the window covers the reach of the largest surfel, so that must be bounded

/// Surfels packed into new pages, as the map's buffers hold them.
struct PackedMap {
  BlockIndex index;               ///< a page that it gives for the first time is free
  std::uint32_t frame;            ///< all pages count as changed in it, so that changes() reports the former surfels of those left empty
  std::vector<cl_uint4> surfels;  ///< [PAGE_SLOTS * pages] up to the last page that has any
  std::vector<cl_ulong> alive;    ///< [pages]
  std::vector<cl_int4> page_block;
  double largest_radius = 0;  ///< [m]

  /// @return slot of the surfel
  std::uint32_t add(const Surfel& surfel, double block_size) {
    const BlockKey block = block_of(surfel.position, block_size);
    const BlockIndex::Pages* pages = index.find(block);
    if (pages == nullptr || alive[pages->back()] == ~cl_ulong{0}) {
      const std::uint32_t page = index.add_page(block);
      pages = index.find(block);
      if (page >= alive.size()) add_empty_pages(page + 1);
      surfels.resize(PAGE_SLOTS * std::max<std::size_t>(page + 1, surfels.size() / PAGE_SLOTS));
      page_block[page] = {{block.x, block.y, block.z, static_cast<cl_int>(frame)}};
    }
    const std::uint32_t page = pages->back(), n = static_cast<std::uint32_t>(__builtin_ctzll(~alive[page])), slot = PAGE_SLOTS * page + n;
    alive[page] |= cl_ulong{1} << n;
    Surfel kept = surfel;
    kept.radius = std::min(surfel.radius, static_cast<float>(kLargestRadius * block_size));
    surfels[slot] = pack(kept, block, block_size);
    largest_radius = std::max<double>(largest_radius, kept.radius);
    return slot;
  }

  void add_empty_pages(std::size_t end) {
    alive.resize(end, 0);
    page_block.resize(end, {{0, 0, 0, static_cast<cl_int>(frame)}});
  }
};

}  // namespace

void SurfelMap::check(const std::vector<Surfel>& surfels) {
  for (const Surfel& surfel : surfels)
    if (!(surfel.position.array().abs() < kFarthest).all())  // true for NaN as well
      throw Error("A surfel's position is not finite or more than 1000 km from the world's origin: give positions in metres.");
}

std::vector<std::uint32_t> SurfelMap::replace(const std::vector<Surfel>& surfels, std::uint32_t frame) {
  check(surfels);
  PackedMap packed{index_.emptied(removal(frame)), frame, {}, {}, {}};
  std::vector<std::uint32_t> slots;
  for (const Surfel& surfel : surfels) slots.push_back(packed.add(surfel, block_size_));
  packed.add_empty_pages(packed.index.end());
  grow(packed.index.end());
  close_window();
  undo_.lost = true;
  alive_.fill("replace", 0, alive_.size());  // a failed frame that could not be undone may have filled pages that no block has
  changed_.fill("replace", 0, changed_.size());
  surfels_.write(packed.surfels);
  alive_.write(packed.alive);
  if (reserves_ids_) reserved_.write(packed.alive);
  page_block_.write(packed.page_block);
  index_ = std::move(packed.index);
  if (logs_changes_) log_.note_all(frame, index_.end());
  size_ = surfels.size();
  largest_radius_ = packed.largest_radius;
  undo_ = {};
  is_ahead_ = false;
  return slots;
}

std::vector<BlockKey> SurfelMap::blocks_changed_since(std::uint32_t frame) const {
  const auto blocks = page_block_.read(index_.end());
  std::vector<BlockKey> changed;
  for (const auto& [block, pages] : index_.blocks()) {
    const auto is_newer = [&](Page page) { return static_cast<std::uint32_t>(blocks[page].s[3]) > frame; };
    if (std::any_of(pages.begin(), pages.end(), is_newer)) changed.push_back(block);
  }
  std::sort(changed.begin(), changed.end());
  return changed;
}

std::vector<StoredBlock> SurfelMap::read_blocks(const std::vector<BlockKey>& blocks) const {
  std::vector<StoredBlock> stored;
  std::vector<Page> pages;
  std::vector<std::size_t> owners;  // index in `stored` for each page
  for (const BlockKey& block : blocks) {
    const BlockIndex::Pages* some = index_.find(block);
    if (some != nullptr) {
      pages.insert(pages.end(), some->begin(), some->end());
      owners.resize(pages.size(), stored.size());
    }
    stored.push_back({block, {}});
  }
  auto owner = owners.begin();
  visit(pages, [&](Page, const cl_int4&, cl_ulong alive, const cl_uint4* surfels) {
    std::vector<std::uint8_t>& bytes = stored[*owner++].second;
    for_each_bit(alive, [&](std::uint32_t n) {
      const auto* begin = reinterpret_cast<const std::uint8_t*>(&surfels[n]);
      bytes.insert(bytes.end(), begin, begin + sizeof(cl_uint4));
    });
  });
  return stored;
}

void SurfelMap::add_block(const BlockKey& block, const std::vector<std::uint8_t>& bytes, std::uint32_t frame) {
  const std::vector<cl_uint4> surfels = to_surfels(bytes);
  const std::size_t pages = (surfels.size() + PAGE_SLOTS - 1) / PAGE_SLOTS;
  grow(index_.end() + pages);
  close_window();
  begin_undo();
  for (std::size_t n = 0; n < pages; ++n) {
    const auto begin = surfels.begin() + PAGE_SLOTS * n;
    const std::vector<cl_uint4> some(begin, std::min(begin + PAGE_SLOTS, surfels.end()));
    const Page page = add_page(block);
    surfels_.write(some, PAGE_SLOTS * page);
    const cl_ulong alive = some.size() == PAGE_SLOTS ? ~cl_ulong{0} : (cl_ulong{1} << some.size()) - 1;
    alive_.write({alive}, page);
    if (reserves_ids_) reserved_.write({alive}, page);
    changed_.write({0}, page);
    page_block_.write({cl_int4{{block.x, block.y, block.z, static_cast<cl_int>(frame)}}}, page);
    if (logs_changes_) log_.note(frame, {page}, {alive});
  }
  size_ += surfels.size();
  for (const cl_uint4& packed : surfels) largest_radius_ = std::max<double>(largest_radius_, unpack(packed, block, block_size_).radius);
  undo_ = {};
}

void SurfelMap::drop_block(const BlockKey& block, std::uint32_t frame) {
  const BlockIndex::Pages* found = index_.find(block);
  if (found == nullptr) return;
  const BlockIndex::Pages pages = *found;
  close_window();
  begin_undo();
  std::size_t dropped = 0;
  for (const Page page : pages) {
    undo_.dropped.emplace_back(page, alive_.read_one(page));
    dropped += static_cast<std::size_t>(__builtin_popcountll(undo_.dropped.back().second));
  }
  for (const Page page : pages) {
    alive_.write({0}, page);
    page_block_.write({cl_int4{{block.x, block.y, block.z, static_cast<cl_int>(frame)}}}, page);
  }
  if (logs_changes_)
    for (const auto& [page, alive] : undo_.dropped) log_.note(frame, {page}, {alive});
  index_.remove_pages(block, pages, removal(frame));
  size_ -= dropped;
  undo_ = {};
}

}  // namespace frontier_surfels
