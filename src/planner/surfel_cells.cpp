#include "planner/surfel_cells.hpp"

#include <utility>
#include <vector>

#include "planner/regions.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "boundaries";
constexpr int kMostCells = 8;                                 // along a block's edge
constexpr std::size_t kCellsOfWindow = std::size_t{1} << 20;  // a larger window gets larger cells

}  // namespace

std::vector<cl_uint> pages_of(const MapWindow& window, const BlockIndex& index) {
  std::vector<cl_uint> pages;
  index.for_each_in(window.window(),
                    [&](int, const BlockKey&, const BlockIndex::Pages& own) { pages.insert(pages.end(), own.begin(), own.end()); });
  return pages;
}

void SurfelCells::list(const Eigen::AlignedBox3d& box_world, const SurfelMap& map) {
  window_ = MapWindow(block_at(box_world.min(), map.block_size()), block_at(box_world.max(), map.block_size()), map.block_size());
  std::vector<cl_uint> pages = pages_of(window_, map.index());
  count_ = pages.size() * PAGE_SLOTS;
  if (empty()) return;
  const auto cell_count = [&] { return static_cast<std::size_t>(window_.cells()) * cells_ * cells_ * cells_; };
  for (cells_ = kMostCells; cells_ > 1 && cell_count() > kCellsOfWindow;) cells_ /= 2;

  const auto page_count = static_cast<cl_int>(pages.size());
  const std::size_t items = pages.size() * (PAGE_SLOTS / commands_.lanes());
  pages_.send(std::move(pages));
  begin_.resize(cell_count() + 2);
  begin_.fill(kStage, 0, cell_count() + 1);
  commands_.run(kStage, "count_in_cells", items, kGroup, window(), cells_, map.surfels(), map.alive(), map.page_block(), pages_(),
                page_count, begin_());
  lists_.prefix_sums(kStage, begin_, cell_count() + 1);
  entries_.resize(count_);
  commands_.run(kStage, "list_by_cells", items, kGroup, window(), cells_, map.surfels(), map.alive(), map.page_block(), pages_(),
                page_count, begin_(), entries_());
}

}  // namespace frontier_surfels
