#include "storage/map_archive.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "map/surfel_packing.hpp"

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

MapArchive::MapArchive(const Config& config, SurfelMap& map)
    : map_(map), radius_(config.eviction_radius), folder_(config.map_folder, map.block_size()) {
  for (const BlockKey& block : folder_.keys()) note_stored(block);
}

MapArchive::~MapArchive() {
  try {
    flush(saved_);
  } catch (const std::exception&) {  // what was saved before is still there
  }
}

void MapArchive::flush(std::uint32_t frame) {
  folder_.flush();
  map_.roll_back();
  if (const Blocks blocks = unsaved(); !blocks.empty()) folder_.write(map_.read_blocks(blocks));
  shrunk_.clear();
  saved_ = frame;
  fault_ = nullptr;
  next_try_ = 0;
  folder_.flush();
}

void MapArchive::note_stored(const BlockKey& block) {
  stored_[region_of(block)].push_back(block);
  stored_bytes_ += folder_.bytes(block);
}

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
  for (const BlockKey& block : near) {
    map_.add_block(block, folder_.read(block), frame);
    stored_bytes_ -= folder_.bytes(block);
    const auto region = stored_.find(region_of(block));
    region->second.erase(std::find(region->second.begin(), region->second.end(), block));
    if (region->second.empty()) stored_.erase(region);
  }
  return !near.empty();
}

/// Those a little further than `radius` stay where they are, so that none goes to and fro; and those that cannot be written.
bool MapArchive::evict(const Eigen::Vector3d& camera, double radius, std::uint32_t frame) {
  Blocks far;
  for (const auto& [block, pages] : map_.index().blocks())
    if (distance(camera, block, map_.block_size()) > radius + 2 * map_.block_size()) far.push_back(block);
  if (far.empty()) return false;
  std::sort(far.begin(), far.end());
  const Blocks changed = unsaved();
  const auto is_unsaved = [&](const BlockKey& block) { return std::binary_search(changed.begin(), changed.end(), block); };
  if (std::any_of(far.begin(), far.end(), is_unsaved) && !save(changed, frame - 1, frame))
    far.erase(std::remove_if(far.begin(), far.end(), is_unsaved), far.end());
  for (const BlockKey& block : far) {
    map_.drop_block(block, frame);
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
  std::set_union(changed.begin(), changed.end(), shrunk_.begin(), shrunk_.end(), std::back_inserter(all));
  return all;
}

/// All or, if it fails, nothing: a fault waits for the next frame, and the next try for some more. Blocks without surfels are erased.
/// @param mapped  the last frame in the map. @param frame  this one
bool MapArchive::save(const Blocks& blocks, std::uint32_t mapped, std::uint32_t frame) {
  if (frame < next_try_) return false;
  try {
    if (!blocks.empty()) folder_.write(map_.read_blocks(blocks));
  } catch (const std::exception&) {
    fault_ = std::current_exception();
    next_try_ = frame + kSavePeriod;
    return false;
  }
  shrunk_.clear();
  saved_ = mapped;
  return true;
}

std::vector<Surfel> MapArchive::stored() const {
  Blocks blocks;
  for (const auto& [region, some] : stored_) blocks.insert(blocks.end(), some.begin(), some.end());
  std::sort(blocks.begin(), blocks.end());
  std::vector<Surfel> surfels;
  for (const BlockKey& block : blocks) {
    const std::vector<Surfel> some = unpack_block(folder_.read(block), block, map_.block_size());
    surfels.insert(surfels.end(), some.begin(), some.end());
  }
  return surfels;
}

std::size_t MapArchive::stored_size() const { return stored_bytes_ / sizeof(cl_uint4); }

void MapArchive::clear() {
  folder_.clear();
  stored_.clear();
  stored_bytes_ = 0;
  followed_.reset();
  shrunk_.clear();
  fault_ = nullptr;
  saved_ = next_try_ = 0;
}

}  // namespace frontier_surfels
