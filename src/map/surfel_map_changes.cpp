/// What readers are told of changes of the map.
#include <algorithm>
#include <optional>
#include <utility>

#include "common/shared.h"
#include "map/bits.hpp"
#include "map/surfel_map.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kGatheredSurfels = 1 << 15;  // surfels that are copied to the host at a time: few enough for the cache

}  // namespace

Changes SurfelMap::changes(std::uint64_t since) const { return changes(log_.since(since)); }

Changes SurfelMap::whole() const {
  const ChangeLog::Words all(index_.end(), ~ChangeLog::Word{0});
  return changes({all, all});
}

/// A device with memory of its own is asked for these pages alone.
ListedPages SurfelMap::list_pages(std::vector<Page> pages) const {
  ListedPages listed = {std::move(pages), {}, {}};
  const std::size_t count = listed.pages.size();
  if (count == 0) return listed;
  if (!commands_.shape().is_near && count < index_.end()) {
    DeviceArray<cl_uint> list(commands_);
    DeviceArray<cl_ulong> alive(commands_);
    DeviceArray<cl_int4> blocks(commands_);
    list.write(listed.pages);
    alive.allocate(count);
    blocks.allocate(count);
    commands_.run("changes", "gather_page_words", count, kGroup, list(), static_cast<cl_uint>(count), alive_(), page_block_(), alive(),
                  blocks());
    listed.alive = alive.read(count);
    listed.blocks = blocks.read(count);
    return listed;
  }
  const auto alive = alive_.read(index_.end());
  const auto blocks = page_block_.read(index_.end());
  for (const Page page : listed.pages) {
    listed.alive.push_back(alive[page]);
    listed.blocks.push_back(blocks[page]);
  }
  return listed;
}

Changes SurfelMap::changes(const ChangeLog::Difference& difference) const {
  std::vector<Page> pages;
  for (Page page = 0; page < std::min(difference.changed.size(), index_.end()); ++page)
    if (difference.changed[page] != 0) pages.push_back(page);
  const ListedPages listed = list_pages(std::move(pages));
  Changes changes;
  std::vector<cl_uint> entries;
  std::size_t updated = 0;
  for (std::size_t n = 0; n < listed.pages.size(); ++n)
    updated += static_cast<std::size_t>(__builtin_popcountll(difference.changed[listed.pages[n]] & listed.alive[n]));
  entries.reserve(updated);
  for (cl_uint n = 0; n < listed.pages.size(); ++n) {
    const Page page = listed.pages[n];
    const ChangeLog::Word changed = difference.changed[page], known = page < difference.known.size() ? difference.known[page] : 0;
    for_each_bit(changed & listed.alive[n], [&](std::uint32_t bit) { entries.push_back(PAGE_SLOTS * n + bit); });
    for_each_bit(changed & known & ~listed.alive[n], [&](std::uint32_t bit) { changes.removed.push_back(PAGE_SLOTS * page + bit); });
  }
  changes.updated.reserve(entries.size());
  if (!entries.empty()) read_surfels(listed, entries, changes.updated);
  return changes;
}

void SurfelMap::read_surfels(const ListedPages& pages, const std::vector<cl_uint>& entries, std::vector<Surfel>& to) const {
  if (commands_.shape().is_near) {
    const std::size_t bytes = PAGE_SLOTS * index_.end() * sizeof(cl_uint4);
    FaultInjection::waits();
    void* surfels = commands_.queue(Call::kRead).enqueueMapBuffer(surfels_(), CL_TRUE, CL_MAP_READ, 0, bytes);
    unpack_entries(static_cast<const cl_uint4*>(surfels), pages, entries, block_size_, to);
    commands_.queue().enqueueUnmapMemObject(surfels_(), surfels);
    return;
  }
  DeviceArray<cl_uint> list(commands_);
  DeviceArray<cl_uint4> gathered(commands_);
  list.allocate(std::min(entries.size(), kGatheredSurfels));
  gathered.allocate(std::min(entries.size(), kGatheredSurfels));
  for (std::size_t begin = 0; begin < entries.size(); begin += kGatheredSurfels) {
    std::vector<cl_uint> some;
    for (std::size_t n = begin; n < std::min(begin + kGatheredSurfels, entries.size()); ++n) some.push_back(pages.slot(entries[n]));
    list.write(some);
    commands_.run("changes", "gather_surfels", some.size(), kGroup, list(), static_cast<cl_uint>(some.size()), surfels_(), gathered());
    unpack_gathered(gathered.read(some.size()), pages, &entries[begin], block_size_, to);
  }
}

void SurfelMap::log_changes(const std::vector<std::uint64_t>& readers, std::uint64_t now) {
  logs_changes_ = !readers.empty();
  if (!logs_changes_) return log_.clear();
  std::optional<ChangeLog::Words> alive = log_.alive_before();
  if (!alive || commands_.shape().is_near) {
    alive = alive_.read(index_.end());
  } else {  // as it was at the last division, but for what has changed since
    alive->resize(index_.end(), 0);
    const ListedPages changed = list_pages(log_.changed_pages(index_.end()));
    for (std::size_t n = 0; n < changed.pages.size(); ++n) (*alive)[changed.pages[n]] = changed.alive[n];
  }
  log_.divide(readers, now, std::move(*alive));
}

void SurfelMap::reserve_ids(const std::vector<std::uint64_t>& readers, std::uint64_t now) {
  log_changes(readers, now);
  if (readers.empty()) {
    reserves_ids_ = false;
    index_.release(~std::uint64_t{0});
    return;
  }
  if (!reserves_ids_) {
    reserved_.allocate(alive_.size());
    reserved_.fill("changes", 0, alive_.size());
  }
  reserved_.write(log_.known(index_.end()));
  reserves_ids_ = true;
  index_.release(readers.front());
}

}  // namespace frontier_surfels
