#include "map/surfel_map.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/shared.h"
#include "map/bits.hpp"
#include "map/surfel_packing.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kGathered = 1 << 14;  // pages that are copied to the host at a time
constexpr std::size_t kSpare = 16;          // buffers get 1 / kSpare more room than needed; on a CPU twice the room, because memory
                                            // costs nothing there until it is touched

BlockKey key_of(const cl_int4& block) { return {block.s[0], block.s[1], block.s[2]}; }

/// Size of the voxels at the grid's far end, with a margin of 20 % [m].
double coarsest_voxel(const Grid& grid) { return 1.2 * grid.z_max / grid.f; }

/// Radius of the largest surfels that a view creates [m].
double largest_created(const Grid& grid) { return std::sqrt(3.0) / 2 * coarsest_voxel(grid); }

}  // namespace

SurfelMap::SurfelMap(Commands& commands, Lists& lists, const Config& config)
    : commands_(commands),
      lists_(lists),
      block_size_(block_size_for(config.z_max)),
      largest_radius_(0),
      thickness_(config.thickness),
      surfels_(commands),
      alive_(commands),
      changed_(commands),
      reserved_(commands),
      page_block_(commands),
      pages_list_(commands),
      page_cells_list_(commands),
      cell_pages_list_(commands),
      new_ranks_list_(commands),
      histogram_(commands),
      cell_begin_(commands),
      free_before_(commands),
      missing_(commands),
      order_(commands),
      new_count_(commands),
      nothing_(commands),
      kept_pages_(commands),
      kept_count_(commands),
      kept_surfel_slots_(commands),
      kept_frames_(commands),
      kept_alive_(commands),
      kept_slots_(commands),
      kept_surfels_(commands),
      changed_words_(commands),
      empty_(commands) {
  grow(1024);
}

/// Makes room for pages. New ones have no bits in `alive` and `changed`, like all pages without surfels.
void SurfelMap::grow(std::size_t pages) {
  constexpr std::size_t kMaxPages = (std::size_t{1} << 32) / PAGE_SLOTS;  // slots are numbered with 32 bits
  if (pages > kMaxPages)
    throw DeviceError("The map would have more than 4.29 billion surfels, which is the limit; raise decimation, or reset the map.");
  const std::size_t kept = index_.end(), spare = commands_.device().is_cpu ? 1 : kSpare;
  surfels_.grow(PAGE_SLOTS * pages, PAGE_SLOTS * kept, spare);
  alive_.grow_filled("creation", 0, pages, kept, spare);
  changed_.grow_filled("creation", 0, pages, kept, spare);
  if (reserves_ids_) reserved_.grow_filled("creation", 0, pages, kept, spare);
  page_block_.grow(pages, kept, spare);
}

/// Largest distance from the grid at which a surfel still matters to it [m].
double SurfelMap::window_margin(const Grid& grid) const {
  const double voxel = coarsest_voxel(grid), largest = std::max(largest_radius_, largest_created(grid));
  const double slope =
      std::max({grid.center_i, grid.size_i - grid.center_i}) / grid.fx + std::max({grid.center_j, grid.size_j - grid.center_j}) / grid.fy;
  return (std::max(2 * largest, thickness_ * voxel) + 2 * voxel) * (1 + slope);
}

double SurfelMap::window_reach(const Grid& grid, const Eigen::Isometry3d& T_world_camera) const {
  const double margin = window_margin(grid);
  const MapWindow window(grid, T_world_camera, block_size_, margin, {});  // throws if the grid is far too large
  return grid_reach(grid) + margin + 2 * block_size_;  // 1 block for rounding to whole ones, 1/2 for a centre, 1/2 for the motion
}

void SurfelMap::open_window(const Grid& grid, const Eigen::Isometry3d& T_world_camera) {
  const double largest = std::max(largest_radius_, largest_created(grid));
  window_ = MapWindow(grid, T_world_camera, block_size_, window_margin(grid), {largest, thickness_});
  begin_undo();
  largest_radius_ = largest;
  listed_cells_.clear();
  for (int cell = 0; cell < window_.cells(); ++cell) {
    const BlockKey block = window_.block(cell);
    listed_cells_.push_back(index_.find(block) != nullptr && window_.meets_grid(block));
  }
  list_window();
}

/// Lists the window's pages, sorted by cell.
void SurfelMap::list_window() {
  std::vector<Page> pages;
  std::vector<cl_uint> page_cells, cell_pages = {0};
  for (int cell = 0; cell < window_.cells(); ++cell) {
    if (listed_cells_[cell]) {
      const BlockIndex::Pages& own = *index_.find(window_.block(cell));
      pages.insert(pages.end(), own.begin(), own.end());
      page_cells.resize(pages.size(), static_cast<cl_uint>(cell));
    }
    cell_pages.push_back(static_cast<cl_uint>(pages.size()));
  }
  set_window(std::move(pages), std::move(page_cells), {});
  cell_pages_list_.send(std::move(cell_pages));
}

void SurfelMap::set_window(std::vector<Page> pages, std::vector<cl_uint> page_cells, std::vector<cl_uint> new_ranks) {
  close_window();  // stays closed if the lists cannot be sent
  pages_list_.send(pages);
  page_cells_list_.send(page_cells);
  new_ranks_list_.send(new_ranks);
  window_pages_ = std::move(pages);
  page_cells_ = std::move(page_cells);
  new_ranks_ = std::move(new_ranks);
}

/// Forgets the window's pages: they may change their blocks.
void SurfelMap::close_window() {
  window_pages_.clear();
  page_cells_.clear();
  new_ranks_.clear();
}

std::size_t SurfelMap::list_pages_near(double distance, DeviceArray<cl_uint>& list) const {
  std::vector<Page> near;
  const auto add = [&](const BlockIndex::Pages& pages) { near.insert(near.end(), pages.begin(), pages.end()); };
  const std::vector<BlockKey> around = window_.blocks_near(distance, index_.blocks().size());
  for (const BlockKey& block : around)
    if (const BlockIndex::Pages* pages = index_.find(block)) add(*pages);
  if (around.empty()) {  // the map has fewer blocks than lie around the window
    for (const auto& [block, pages] : index_.blocks())
      if (window_.is_near(block, distance)) add(pages);
  }
  list.write(near);
  return near.size();
}

void SurfelMap::reserve(std::size_t additional) {
  const std::size_t blocks = std::min<std::size_t>(additional, window_.cells());
  grow(index_.end() + additional / PAGE_SLOTS + blocks);
}

void SurfelMap::insert(const char* stage, const DeviceArray<cl_uint4>& surfels, const DeviceArray<cl_uint>& cells, std::size_t count) {
  if (count == 0) return;
  if (!new_ranks_.empty()) list_window();  // an earlier insertion has added pages, which are not sorted by cell yet
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
  if (!new_ranks_.empty()) return false;
  sort(stage, cells, leaving);
  missing_told_ = missing_.read_later(window_.cells());
  return true;
}

void SurfelMap::insert_sorted(const char* stage, const DeviceArray<cl_uint4>& surfels, std::size_t count) {
  if (count == 0) return;
  add_pages(missing_told_ != nullptr ? *missing_told_ : missing_.read(window_.cells()));
  missing_told_ = nullptr;
  const std::size_t items = window_pages() * (commands_.shape().many_items ? PAGE_SLOTS : 1);
  commands_.run(stage, "fill_pages", items, PAGE_GROUP, window_.window(), pages_list_(), page_cells_list_(),
                static_cast<cl_uint>(window_pages()), new_ranks_list_(), static_cast<cl_uint>(new_ranks_.size()), cell_begin_(),
                cell_pages_list_(), free_before_(), order_(), surfels(), page_block_(), alive_(), changed_(), reserved(), surfels_());
  size_ += count;
}

void SurfelMap::sort(const char* stage, const NewCells& cells, const DeviceArray<cl_ulong>& leaving) {
  const auto cell_count = static_cast<cl_uint>(window_.cells()), pages = static_cast<cl_uint>(window_pages());
  free_before_.resize(pages + 1);
  cell_begin_.resize(cell_count + 1);
  missing_.resize(cell_count);
  order_.resize(cells.room);
  const std::size_t alone = commands_.shape().sort_alone;
  if (alone == 0 || cells.expected > alone) return sort_by_cell(stage, cells, leaving);
  commands_.run(stage, "sort_few", 1, 1, cells.cells(), cells.length, pages_list_(), pages, leaving(), alive_(),
                static_cast<cl_int>(reserves_ids_), reserved(), cell_pages_list_(), cell_count, free_before_(), cell_begin_(), missing_(),
                order_());
}

void SurfelMap::sort_by_cell(const char* stage, const NewCells& cells, const DeviceArray<cl_ulong>& leaving) {
  const auto cell_count = static_cast<cl_uint>(window_.cells()), pages = static_cast<cl_uint>(window_pages());
  const std::size_t bins = commands_.shape().sort_chunks * cell_count, group = commands_.shape().sort_group;
  const auto chunks = static_cast<cl_uint>(commands_.shape().sort_chunks);
  histogram_.resize(bins + 1);
  histogram_.fill(stage, 0, bins);
  commands_.run(stage, "count_cells", chunks, group, cells.cells(), cells.length, chunks, histogram_());
  lists_.prefix_sums(stage, histogram_, bins);
  if (pages == 0) free_before_.fill(stage, 0, 1);
  commands_.run(stage, "count_free", pages, kGroup, pages_list_(), pages, leaving(), alive_(), static_cast<cl_int>(reserves_ids_),
                reserved(), free_before_());
  lists_.prefix_sums(stage, free_before_, pages);
  commands_.run(stage, "begin_cells", cell_count + 1, kGroup, histogram_(), cell_pages_list_(), free_before_(), cell_count, chunks,
                cell_begin_(), missing_());
  commands_.run(stage, "sort_by_cell", chunks, group, cells.cells(), cells.length, chunks, histogram_(), order_());
}

/// Appends new pages to the window. @param missing  number of new pages for each cell
void SurfelMap::add_pages(const std::vector<cl_uint>& missing) {
  grow(index_.end() + std::accumulate(missing.begin(), missing.end(), std::size_t{0}));
  std::vector<Page> pages = window_pages_;
  std::vector<cl_uint> page_cells = page_cells_, ranks;
  for (std::size_t cell = 0; cell < missing.size(); ++cell) {
    if (missing[cell] > 0) listed_cells_[cell] = true;
    for (cl_uint rank = 0; rank < missing[cell]; ++rank) {
      pages.push_back(add_page(window_.block(static_cast<int>(cell))));
      page_cells.push_back(static_cast<cl_uint>(cell));
      ranks.push_back(rank);
    }
  }
  if (!ranks.empty()) set_window(std::move(pages), std::move(page_cells), std::move(ranks));
}

void SurfelMap::finish_frame(const char* stage, std::uint32_t frame) {
  const auto count = static_cast<cl_uint>(window_pages());
  changed_words_.resize(count + 1);
  empty_.resize(count + 1);
  commands_.run(stage, "finish_pages", count, kGroup, pages_list_(), count, alive_(), changed_(), frame, page_block_(), changed_words_(),
                empty_());
  const auto changes = changed_words_.read_later(logs_changes_ ? count : 0);
  const std::vector<cl_uchar> empty = empty_.read(count);  // waits for both, and for the whole frame
  frame_changes_ = *changes;
  empty_pages_.clear();
  for (cl_uint n = 0; n < count; ++n)
    if (empty[n]) empty_pages_.push_back(n);
}

Surfel SurfelMap::to_surfel(const cl_uint4& packed, const cl_int4& block, std::uint32_t slot) const {
  Surfel surfel = unpack(packed, key_of(block), block_size_);
  surfel.id = slot;
  return surfel;
}

/// Copies pages to the host, kGathered at a time, and calls the visitor for each.
void SurfelMap::visit(const std::vector<Page>& pages, const PageVisitor& visitor) const {
  const ListedPages listed = list_pages(pages);
  DeviceArray<cl_uint> list(commands_);
  DeviceArray<cl_uint4> gathered(commands_);
  for (std::size_t begin = 0; begin < pages.size(); begin += kGathered) {
    const std::vector<Page> some(pages.begin() + begin, pages.begin() + std::min(begin + kGathered, pages.size()));
    list.write(some);
    gathered.resize(PAGE_SLOTS * some.size());
    commands_.run("changes", "gather_pages", PAGE_SLOTS * some.size(), kGroup, list(), static_cast<cl_uint>(some.size()), surfels_(),
                  gathered());
    const auto surfels = gathered.read(PAGE_SLOTS * some.size());
    for (std::size_t n = 0; n < some.size(); ++n)
      visitor(some[n], listed.blocks[begin + n], listed.alive[begin + n], &surfels[PAGE_SLOTS * n]);
  }
}

std::vector<Surfel> SurfelMap::download() const {
  const auto alive = alive_.read(index_.end());
  std::vector<Page> pages;
  for (Page page = 0; page < alive.size(); ++page)
    if (alive[page] != 0) pages.push_back(page);
  std::vector<Surfel> surfels;
  surfels.reserve(size());
  visit(pages, [&](Page page, const cl_int4& block, cl_ulong alive, const cl_uint4* packed) {
    for_each_bit(alive, [&](std::uint32_t n) { surfels.push_back(to_surfel(packed[n], block, PAGE_SLOTS * page + n)); });
  });
  return surfels;
}

std::size_t SurfelMap::allocated_bytes() const {
  return surfels_.bytes() + alive_.bytes() + changed_.bytes() + reserved_.bytes() + page_block_.bytes();
}

std::size_t SurfelMap::bytes() const { return allocated_bytes() - untouched_bytes() + index_.bytes() + log_.bytes(); }

std::size_t SurfelMap::untouched_bytes() const {
  if (!commands_.device().is_cpu) return 0;
  // Without `alive`, `changed` and `reserved`: these are filled with zeros, hence touched.
  constexpr std::size_t kPage = PAGE_SLOTS * sizeof(cl_uint4) + sizeof(cl_int4);
  return surfels_.bytes() + page_block_.bytes() - kPage * index_.end();
}

}  // namespace frontier_surfels
