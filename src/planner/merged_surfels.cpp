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
      list_(commands),
      sums_(commands),
      table_(commands),
      counts_(commands),
      merged_(commands) {}

void MergedSurfels::merge(const char* stage, const SurfelMap& map, const std::vector<const BlockIndex::Pages*>& pages,
                          const std::vector<cl_uint>& levels) {
  std::vector<cl_uint> all, begin = {0}, list;
  for (const BlockIndex::Pages* own : pages) {
    all.insert(all.end(), own->begin(), own->end());
    begin.push_back(static_cast<cl_uint>(all.size()));
  }
  std::size_t most_pages = 1;
  for (std::size_t block = 0; block < pages.size(); ++block) {
    if (levels[block] == 0) continue;
    list.push_back(static_cast<cl_uint>(block << MERGE_LEVELS) | levels[block]);
    most_pages = std::max(most_pages, pages[block]->size());
  }
  const std::size_t most_sums = PAGE_SLOTS * most_pages, bytes = most_sums * MERGE_SUM_WORDS * sizeof(cl_uint);
  const std::size_t workers = std::clamp(kMostScratchBytes / bytes, std::size_t{1}, kMostWorkers);

  merged_.resize(PAGE_SLOTS * (list.empty() ? 1 : MERGE_LEVELS * all.size() + 1));  // whole vectors are read at their ends
  counts_.resize(MERGE_LEVELS * pages.size() + 1);
  pages_.send(std::move(all));
  page_begin_.send(std::move(begin));
  if (list.empty()) return;
  sums_.resize(workers * most_sums * MERGE_SUM_WORDS);
  table_.resize(workers * kTableCells);
  table_.fill(stage, 0, workers * kTableCells);
  const auto count = static_cast<cl_uint>(list.size());
  list_.send(std::move(list));
  commands_.run(stage, "merge_surfels", workers, commands_.shape().heavy_group, static_cast<cl_float>(map.block_size()), map.surfels(),
                map.alive(), pages_(), page_begin_(), static_cast<cl_uint>(pages.size()), list_(), count, static_cast<cl_uint>(workers),
                sums_(), static_cast<cl_uint>(most_sums), table_(), merged_(), counts_());
}

}  // namespace frontier_surfels
