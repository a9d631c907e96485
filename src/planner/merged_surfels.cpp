#include "planner/merged_surfels.hpp"

#include <algorithm>
#include <utility>

namespace frontier_surfels {
namespace {

constexpr std::size_t kMostWorkers = 64;
constexpr std::size_t kMostScratchBytes = std::size_t{64} << 20;  // unless one worker needs more
constexpr std::size_t kTableCells = MERGE_CELLS * MERGE_CELLS * MERGE_CELLS;

}  // namespace

MergedSurfels::MergedSurfels(Commands& commands)
    : commands_(commands),
      pages_(commands),
      page_begin_(commands),
      places_(commands),
      list_(commands),
      sums_(commands),
      table_(commands),
      counts_(commands),
      merged_(commands) {}

void MergedSurfels::merge(const char* stage, const SurfelMap& map, const std::vector<const BlockIndex::Pages*>& pages,
                          const std::vector<cl_uint>& levels, std::uint64_t now) {
  std::vector<cl_uint> all, begin = {0};
  std::size_t most_pages = 1, merged_pages = 0;
  for (std::size_t block = 0; block < pages.size(); ++block) {
    all.insert(all.end(), pages[block]->begin(), pages[block]->end());
    begin.push_back(static_cast<cl_uint>(all.size()));
    if (levels[block] == 0) continue;
    most_pages = std::max(most_pages, pages[block]->size());
    merged_pages += pages[block]->size();
  }
  pages_.send(std::move(all));
  page_begin_.send(std::move(begin));
  if (end_ > 2 * merged_pages + PAGE_SLOTS) forget();  // most places are of blocks that have changed, or are not asked for
  for (bool may_forget = end_ > 0;; may_forget = false) {
    try {
      std::vector<cl_uint> list = plan(map, pages, levels, now);
      if (!list.empty()) merge_listed(stage, map, most_pages, std::move(list));
      return;
    } catch (...) {
      forget();  // what is planned has not been merged
      if (!may_forget) throw;
    }
  }
}

void MergedSurfels::forget() {
  kept_.clear();
  end_ = 0;
}

/// Finds a place for each block whose merged surfels are needed. @return the blocks that must be merged, as merge_surfels takes them
std::vector<cl_uint> MergedSurfels::plan(const SurfelMap& map, const std::vector<const BlockIndex::Pages*>& pages,
                                         const std::vector<cl_uint>& levels, std::uint64_t now) {
  BlockIndex::Pages asked;
  for (std::size_t block = 0; block < pages.size(); ++block)
    if (levels[block] != 0) asked.insert(asked.end(), pages[block]->begin(), pages[block]->end());
  const ListedPages listed = map.list_pages(std::move(asked));
  const cl_uint before = end_;
  std::vector<cl_uint> places(pages.size(), 0), list;
  auto next = listed.blocks.begin();
  for (std::size_t block = 0; block < pages.size(); ++block) {
    if (levels[block] == 0) continue;
    std::uint32_t changed = 0;
    for (std::size_t n = 0; n < pages[block]->size(); ++n, ++next) changed = std::max(changed, static_cast<std::uint32_t>(next->s[3]));
    Kept& kept = keep(*pages[block], changed, now);
    places[block] = kept.place;
    if ((levels[block] & ~kept.levels) == 0) continue;
    kept.levels |= levels[block];
    list.push_back(static_cast<cl_uint>(block << MERGE_LEVELS) | kept.levels);
  }
  places_.send(std::move(places));
  constexpr std::size_t kSpare = 4;
  merged_.grow(PAGE_SLOTS * (MERGE_LEVELS * std::size_t{end_} + 1), PAGE_SLOTS * MERGE_LEVELS * std::size_t{before},
               kSpare);  // whole vectors are read at the end
  counts_.grow(MERGE_LEVELS * std::size_t{end_} + 1, MERGE_LEVELS * std::size_t{before}, kSpare);
  return list;
}

/// @return what is kept of a block, or a place without levels if that is not up to date
MergedSurfels::Kept& MergedSurfels::keep(const BlockIndex::Pages& pages, std::uint32_t changed, std::uint64_t now) {
  const auto [found, is_new] = kept_.try_emplace(pages.front());
  Kept& kept = found->second;
  if (!is_new && kept.changed == changed && kept.pages == pages) return kept;
  if (is_new || kept.pages.size() != pages.size()) {
    kept.place = end_;
    end_ += static_cast<cl_uint>(pages.size());
  }
  kept.pages = pages;
  kept.changed = changed <= now ? changed : kNeverAgain;
  kept.levels = 0;
  return kept;
}

void MergedSurfels::merge_listed(const char* stage, const SurfelMap& map, std::size_t most_pages, std::vector<cl_uint> list) {
  const std::size_t most_sums = PAGE_SLOTS * most_pages, bytes = most_sums * MERGE_SUM_WORDS * sizeof(cl_uint);
  const std::size_t workers = std::clamp(kMostScratchBytes / bytes, std::size_t{1}, kMostWorkers);
  sums_.resize(workers * most_sums * MERGE_SUM_WORDS);
  table_.resize(workers * kTableCells);
  table_.fill(stage, 0, workers * kTableCells);
  const auto count = static_cast<cl_uint>(list.size());
  list_.send(std::move(list));
  commands_.run(stage, "merge_surfels", workers, commands_.shape().heavy_group, static_cast<cl_float>(map.block_size()), map.surfels(),
                map.alive(), pages_(), page_begin_(), places_(), list_(), count, static_cast<cl_uint>(workers), sums_(),
                static_cast<cl_uint>(most_sums), table_(), merged_(), counts_());
}

}  // namespace frontier_surfels
