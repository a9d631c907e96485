#include "storage/map_archive.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "map/surfel_packing.hpp"
#include "map/view_packing.hpp"
#include "storage/stored_block.hpp"

namespace frontier_surfels {
namespace {

constexpr std::int32_t kRegion = 8;        // blocks along the edge of a region of the index
constexpr std::uint32_t kSavePeriod = 20;  // frames: so many a kill costs at most, and those that come until they are written

std::int32_t floor_divide(std::int32_t a, std::int32_t b) { return a / b - (a % b < 0 ? 1 : 0); }

BlockKey region_of(const BlockKey& block) {
  return {floor_divide(block.x, kRegion), floor_divide(block.y, kRegion), floor_divide(block.z, kRegion)};
}

/// Largest distance along an axis between a point and a cube's centre [m].
double distance(const Eigen::Vector3d& point, const BlockKey& cube, double size) {
  return (point - (Eigen::Vector3d(cube.x, cube.y, cube.z).array() + 0.5).matrix() * size).cwiseAbs().maxCoeff();
}

}  // namespace

MapArchive::MapArchive(const Config& config, SurfelMap& map, SeenPoints& seen, const RecentViews& views)
    : map_(map), seen_(seen), views_(views), radius_(config.eviction_radius), folder_(config.map_folder, map.block_size()) {
  for (const BlockKey& key : folder_.keys()) {
    if (is_view(key))
      old_views_.insert(number_of(key));
    else
      note_stored(key);
  }
  choose_lattice();
}

MapArchive::~MapArchive() {
  try {
    flush(saved_);
  } catch (const std::exception&) {  // what was saved before is still there
  }
}

/// The lattice is that of the blocks in the folder. One that can be read is enough.
void MapArchive::choose_lattice() {
  for (const auto& [region, blocks] : stored_)
    for (const BlockKey& block : blocks) {
      try {
        return seen_.choose_shift(parts_of(folder_.read(block)).shift);
      } catch (const FileError&) {  // frames that need the block will tell
      }
    }
}

void MapArchive::flush(std::uint32_t frame) {
  folder_.flush();
  map_.roll_back();
  write(unsaved());
  saved_ = frame;
  fault_ = nullptr;
  next_try_ = 0;
  folder_.flush();
}

void MapArchive::note_stored(const BlockKey& block) { stored_[region_of(block)].push_back(block); }

bool MapArchive::follow(const Eigen::Vector3d& camera, double reach, std::uint32_t frame) {
  if (fault_) std::rethrow_exception(std::exchange(fault_, nullptr));
  const double radius = std::max(radius_, reach);
  if (followed_ && (camera - *followed_).norm() < map_.block_size() / 2 && radius <= followed_radius_) return false;
  followed_.reset();  // if not all blocks come and go, the next frame tries again
  const bool evicted = evict(camera, radius, frame), fetched = fetch(camera, radius, frame);
  followed_ = camera;
  followed_radius_ = radius;
  return evicted || fetched;
}

MapArchive::Blocks MapArchive::stored_near(const Eigen::Vector3d& camera, double radius) const {
  const double size = map_.block_size() * kRegion;
  const Eigen::Array3d low = ((camera.array() - radius) / size).floor(), high = ((camera.array() + radius) / size).floor();
  Blocks near;
  const auto add_near_ones = [&](const Blocks& blocks) {
    for (const BlockKey& block : blocks)
      if (distance(camera, block, map_.block_size()) <= radius) near.push_back(block);
  };
  if ((high - low + 1).prod() >= static_cast<double>(stored_.size())) {
    for (const auto& [region, blocks] : stored_) add_near_ones(blocks);
  } else {
    for (double z = low.z(); z <= high.z(); ++z)
      for (double y = low.y(); y <= high.y(); ++y)
        for (double x = low.x(); x <= high.x(); ++x) {
          const auto found = stored_.find({static_cast<std::int32_t>(x), static_cast<std::int32_t>(y), static_cast<std::int32_t>(z)});
          if (found != stored_.end()) add_near_ones(found->second);
        }
  }
  std::sort(near.begin(), near.end());
  return near;
}

bool MapArchive::fetch(const Eigen::Vector3d& camera, double radius, std::uint32_t frame) {
  const Blocks near = stored_near(camera, radius);
  std::vector<SeenBlock> seen;
  try {
    for (const BlockKey& block : near) {
      const StoredParts parts = parts_of(folder_.read(block));
      map_.add_block(block, parts.surfels, frame);
      seen.push_back({block, parts.seen});
      const auto region = stored_.find(region_of(block));
      region->second.erase(std::find(region->second.begin(), region->second.end(), block));
      if (region->second.empty()) stored_.erase(region);
    }
  } catch (...) {
    seen_.add_blocks(seen);  // of the blocks that are in memory now
    throw;
  }
  seen_.add_blocks(seen);
  return !near.empty();
}

/// Those a little further than `radius` stay where they are, so that none goes to and fro; and those that cannot be written.
bool MapArchive::evict(const Eigen::Vector3d& camera, double radius, std::uint32_t frame) {
  Blocks far;
  for (const BlockKey& block : in_memory())
    if (distance(camera, block, map_.block_size()) > radius + 2 * map_.block_size()) far.push_back(block);
  if (far.empty()) return false;
  const Blocks changed = unsaved();
  const auto is_unsaved = [&](const BlockKey& block) { return std::binary_search(changed.begin(), changed.end(), block); };
  if (std::any_of(far.begin(), far.end(), is_unsaved) && !save(changed, frame - 1, frame))
    far.erase(std::remove_if(far.begin(), far.end(), is_unsaved), far.end());
  for (const BlockKey& block : far) {
    map_.drop_block(block, frame);
    seen_.drop_block(block);
    note_stored(block);
  }
  return !far.empty();
}

void MapArchive::save_some(std::uint32_t frame) {
  if (frame < saved_ + kSavePeriod && saved_ != 0) return;
  try {
    save(unsaved(), frame, frame);
  } catch (const std::exception&) {  // the device failed, and the frame is in the map already
    fault_ = std::current_exception();
  }
}

/// Sorted. Blocks that have become empty are among them.
MapArchive::Blocks MapArchive::unsaved() const {
  const Blocks changed = map_.blocks_changed_since(saved_);
  Blocks all;
  std::set_union(changed.begin(), changed.end(), noted_.begin(), noted_.end(), std::back_inserter(all));
  return all;
}

/// All or, if it fails, nothing: a fault waits for the next frame, and the next try for some more. Blocks without surfels are erased.
/// @param mapped  the last frame in the map. @param frame  this one
bool MapArchive::save(const Blocks& blocks, std::uint32_t mapped, std::uint32_t frame) {
  if (frame < next_try_) return false;
  try {
    write(blocks);
  } catch (const std::exception&) {
    fault_ = std::current_exception();
    next_try_ = frame + kSavePeriod;
    return false;
  }
  saved_ = mapped;
  return true;
}

/// Queues the blocks, and the changes of the kept views, as one transaction.
void MapArchive::write(const Blocks& blocks) {
  if (std::vector<StoredBlock> stored = read(blocks); !stored.empty()) folder_.write(std::move(stored));
  noted_.clear();
  old_views_.clear();
  const std::vector<std::uint64_t> kept = views_.numbers();
  saved_views_ = {kept.begin(), kept.end()};
}

/// Blocks with surfels, or in which something has been seen; sorted.
MapArchive::Blocks MapArchive::in_memory() const {
  Blocks with_surfels;
  for (const auto& [block, pages] : map_.index().blocks()) with_surfels.push_back(block);
  std::sort(with_surfels.begin(), with_surfels.end());
  const Blocks seen = seen_.blocks_with_points();
  Blocks all;
  std::set_union(with_surfels.begin(), with_surfels.end(), seen.begin(), seen.end(), std::back_inserter(all));
  return all;
}

/// The blocks as the folder keeps them.
std::vector<StoredBlock> MapArchive::read(const Blocks& blocks) const {
  std::vector<StoredBlock> stored = map_.read_blocks(blocks);
  std::vector<std::vector<std::uint8_t>> seen = seen_.read_blocks(blocks);
  for (std::size_t n = 0; n < stored.size(); ++n) stored[n].second = join({seen_.shift(), std::move(stored[n].second), std::move(seen[n])});
  add_views(stored);
  return stored;
}

/// Adds the views that are kept but not on disk, and erases those on disk that are no longer kept.
void MapArchive::add_views(std::vector<StoredBlock>& stored) const {
  const std::vector<std::uint64_t> numbers = views_.numbers();
  const std::set<std::uint64_t> kept(numbers.begin(), numbers.end());
  for (const std::set<std::uint64_t>* on_disk : {&old_views_, &saved_views_})
    for (const std::uint64_t number : *on_disk)
      if (kept.count(number) == 0) stored.push_back({view_key(number), {}});
  for (const std::uint64_t number : numbers)
    if (saved_views_.count(number) == 0) stored.push_back({view_key(number), pack_view(views_.saved(number))});
}

std::vector<SavedView> MapArchive::stored_views() const {
  std::vector<SavedView> views;
  for (const std::uint64_t number : old_views_) {
    const std::vector<std::uint8_t> bytes = folder_.read(view_key(number));
    std::size_t used = 0;
    views.push_back(unpack_view(bytes.data(), bytes.size(), &used));
  }
  return views;
}

void MapArchive::add_stored(SavedMap& map) const {
  Blocks blocks;
  for (const auto& [region, some] : stored_) blocks.insert(blocks.end(), some.begin(), some.end());
  std::sort(blocks.begin(), blocks.end());
  for (const BlockKey& block : blocks) {
    const StoredParts parts = parts_of(folder_.read(block));
    const std::vector<Surfel> some = unpack_block(parts.surfels, block, map_.block_size());
    map.surfels.insert(map.surfels.end(), some.begin(), some.end());
    if (!parts.seen.empty()) map.seen.blocks.push_back({{block.x, block.y, block.z}, parts.seen});
  }
}

void MapArchive::clear() {
  folder_.clear();
  stored_.clear();
  followed_.reset();
  noted_.clear();
  fault_ = nullptr;
  saved_views_.clear();
  old_views_.clear();
  saved_ = next_try_ = 0;
}

}  // namespace frontier_surfels
