#include "map_archive.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "surfel_packing.hpp"

namespace frontier_surfels {
namespace {

constexpr std::int32_t kRegion = 8;        // blocks along the edge of a region of the index
constexpr std::uint32_t kSavePeriod = 30;  // frames: so many a kill may cost

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
    save(saved_);
    folder_.flush();
  } catch (const std::exception&) {  // what was saved before is still there
  }
}

void MapArchive::note_stored(const BlockKey& block) { stored_[region_of(block)].push_back(block); }

bool MapArchive::follow(const Eigen::Vector3d& camera, std::uint32_t frame) {
  if (fault_) std::rethrow_exception(std::exchange(fault_, nullptr));
  if (followed_ && (camera - *followed_).norm() < map_.block_size() / 2) return false;
  const bool evicted = evict(camera, frame), fetched = fetch(camera, frame);
  followed_ = camera;
  return evicted || fetched;
}

/// In memory are blocks up to radius_; those a little further stay where they are, so that none goes to and fro.
MapArchive::Blocks MapArchive::stored_near(const Eigen::Vector3d& camera) const {
  const double size = map_.block_size() * kRegion;
  const Eigen::Array3d low = ((camera.array() - radius_) / size).floor(), high = ((camera.array() + radius_) / size).floor();
  Blocks near;
  for (double z = low.z(); z <= high.z(); ++z)
    for (double y = low.y(); y <= high.y(); ++y)
      for (double x = low.x(); x <= high.x(); ++x) {
        const auto found = stored_.find({static_cast<std::int32_t>(x), static_cast<std::int32_t>(y), static_cast<std::int32_t>(z)});
        if (found == stored_.end()) continue;
        for (const BlockKey& block : found->second)
          if (distance(camera, block, map_.block_size()) <= radius_) near.push_back(block);
      }
  std::sort(near.begin(), near.end());
  return near;
}

bool MapArchive::fetch(const Eigen::Vector3d& camera, std::uint32_t frame) {
  const Blocks near = stored_near(camera);
  for (const BlockKey& block : near) {
    map_.add_block(block, folder_.read(block), frame);
    const auto region = stored_.find(region_of(block));
    region->second.erase(std::find(region->second.begin(), region->second.end(), block));
    if (region->second.empty()) stored_.erase(region);
  }
  return !near.empty();
}

bool MapArchive::evict(const Eigen::Vector3d& camera, std::uint32_t frame) {
  Blocks far;
  for (const auto& [block, pages] : map_.index().blocks())
    if (distance(camera, block, map_.block_size()) > radius_ + 2 * map_.block_size()) far.push_back(block);
  if (far.empty()) return false;
  std::sort(far.begin(), far.end());
  write(far);
  for (const BlockKey& block : far) {
    map_.drop_block(block, frame);
    note_stored(block);
  }
  return true;
}

void MapArchive::save_some(const std::vector<BlockKey>& emptied, std::uint32_t frame) {
  emptied_.insert(emptied_.end(), emptied.begin(), emptied.end());
  if (frame < saved_ + kSavePeriod) return;
  try {
    save(frame);
  } catch (const FileError&) {  // the frame itself is mapped
    fault_ = std::current_exception();
  }
}

void MapArchive::save(std::uint32_t frame) {
  Blocks blocks = map_.blocks_changed_since(saved_);
  std::sort(emptied_.begin(), emptied_.end());
  emptied_.erase(std::unique(emptied_.begin(), emptied_.end()), emptied_.end());
  for (const BlockKey& block : emptied_)
    if (map_.index().find(block) == nullptr && folder_.contains(block)) blocks.push_back(block);
  write(blocks);
  emptied_.clear();
  saved_ = frame;
}

/// Blocks without surfels are erased.
void MapArchive::write(const Blocks& blocks) {
  if (!blocks.empty()) folder_.write(map_.read_blocks(blocks));
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

void MapArchive::clear() {
  folder_.clear();
  stored_.clear();
  followed_.reset();
  emptied_.clear();
  saved_ = 0;
}

}  // namespace frontier_surfels
