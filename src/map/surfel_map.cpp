#include "map/surfel_map.hpp"

#include <algorithm>
#include <cmath>

#include "common/shared.h"
#include "map/bits.hpp"
#include "map/surfel_packing.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kLeastSpares = 1024;  // pages that a frame which goes ahead may add
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
      histogram_(commands),
      cell_begin_(commands),
      free_before_(commands),
      missing_before_(commands),
      order_(commands),
      new_count_(commands),
      nothing_(commands),
      always_(commands),
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
  std::vector<cl_uint> counts(COUNTS, 0);
  counts[COUNT_GOES_ON] = 1;
  always_.write(counts);
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
  choose_spare_pages();
  largest_radius_ = largest;
  listed_.assign(static_cast<std::size_t>(window_.cells()), nullptr);
  index_.for_each_in(window_.window(), [&](int cell, const BlockKey& block, const BlockIndex::Pages& pages) {
    if (window_.meets_grid(block)) listed_[static_cast<std::size_t>(cell)] = &pages;
  });
  list_window();
}

/// With too little memory for them, the frame gets those that there are.
void SurfelMap::choose_spare_pages() {
  if (commands_.shape().is_near) return;
  spare_pages_ = index_.next_pages(std::max(next_spares_, kLeastSpares));
  if (has_memory_for([&] { grow(1 + *std::max_element(spare_pages_.begin(), spare_pages_.end())); })) return;
  std::size_t room = std::min({surfels_.size() / PAGE_SLOTS, alive_.size(), changed_.size(), page_block_.size()});
  if (reserves_ids_) room = std::min(room, reserved_.size());
  const auto beyond = std::find_if(spare_pages_.begin(), spare_pages_.end(), [&](Page page) { return page >= room; });
  spare_pages_.erase(beyond, spare_pages_.end());
  next_spares_ = 0;
}

/// Lists the window's pages, sorted by cell.
void SurfelMap::list_window() {
  close_window();
  std::vector<cl_uint> cell_pages = {0};
  for (int cell = 0; cell < window_.cells(); ++cell) {
    if (const BlockIndex::Pages* own = listed_[static_cast<std::size_t>(cell)]; own != nullptr) {
      window_pages_.insert(window_pages_.end(), own->begin(), own->end());
      page_cells_.resize(window_pages_.size(), static_cast<cl_uint>(cell));
    }
    cell_pages.push_back(static_cast<cl_uint>(window_pages_.size()));
  }
  sorted_pages_ = window_pages_.size();
  page_cells_list_.send(page_cells_);
  cell_pages_list_.send(std::move(cell_pages));
  send_pages();
}

void SurfelMap::send_pages() {
  std::vector<Page> pages = window_pages_;
  pages.insert(pages.end(), spare_pages_.begin(), spare_pages_.end());
  pages_list_.send(std::move(pages));
}

/// Forgets the window's pages: they may change their blocks.
void SurfelMap::close_window() {
  window_pages_.clear();
  page_cells_.clear();
  sorted_pages_ = 0;
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
