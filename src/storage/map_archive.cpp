#include "storage/map_archive.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "map/seen_block.hpp"
#include "map/seen_box.hpp"
#include "map/surfel_packing.hpp"
#include "map/view_packing.hpp"

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

MapArchive::MapArchive(const Config& config, SurfelMap& map, SeenPoints& seen, const RecentViews& views, std::function<Blocks()> complete)
    : map_(map),
      seen_(seen),
      views_(views),
      complete_(std::move(complete)),
      radius_(config.eviction_radius),
      path_(config.map_folder),
      folder_(config.map_folder, map.block_size()) {
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

/// The lattice is that of the seen points in the folder. One block that can be read is enough; those without seen points may have been
/// stored before the lattice was chosen.
void MapArchive::choose_lattice() {
  for (const auto& [region, blocks] : stored_)
    for (const BlockKey& block : blocks) {
      try {
        const StoredParts parts = parts_of(folder_.read(block));
        if (!parts.seen.empty()) return seen_.choose_shift(parts.shift);
      } catch (const FileError&) {  // frames that need the block will tell
      }
    }
}

void MapArchive::flush(std::uint32_t frame) {
  folder_.flush();
  map_.roll_back();
  note_changed(complete_());
  write(unsaved());
  saved_ = frame;
  fault_ = nullptr;
  next_try_ = 0;
  folder_.flush();
}

bool MapArchive::is_stored(const BlockKey& block) const {
  const auto region = stored_.find(region_of(block));
  return region != stored_.end() && std::find(region->second.begin(), region->second.end(), block) != region->second.end();
}

void MapArchive::note_stored(const BlockKey& block) {
  if (is_stored(block) || !folder_.contains(block)) return;
  stored_[region_of(block)].push_back(block);
  stored_surfels_ += folder_.surfels(block);
}

void MapArchive::forget_stored(const BlockKey& block) {
  const auto region = stored_.find(region_of(block));
  region->second.erase(std::find(region->second.begin(), region->second.end(), block));
  if (region->second.empty()) stored_.erase(region);
  stored_surfels_ -= folder_.surfels(block);
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

/// First the seen points of all blocks, and then surfels block by block: if that fails half way, blocks have their seen points in memory
/// and on disk, which does no harm.
bool MapArchive::fetch(const Eigen::Vector3d& camera, double radius, std::uint32_t frame) {
  const Blocks near = stored_near(camera, radius);
  if (near.empty()) return false;
  std::vector<StoredParts> parts;
  std::vector<SeenBlock> seen;
  const std::vector<std::vector<std::uint8_t>> in_memory = seen_.read_blocks(near);
  for (std::size_t n = 0; n < near.size(); ++n) {
    parts.push_back(stored_parts(near[n]));
    seen.push_back({near[n], united(parts[n].seen, in_memory[n])});
  }
  seen_.add_blocks(seen);
  for (std::size_t n = 0; n < near.size(); ++n) {
    map_.add_block(near[n], parts[n].surfels, frame);
    forget_stored(near[n]);
  }
  return true;
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
    note_changed(complete_());
    save(unsaved(), frame, frame);
  } catch (const std::exception&) {  // the device failed, and the frame is in the map already
    fault_ = std::current_exception();
  }
}

/// All blocks of the box are noted before anything is forgotten, and so go to disk together.
void MapArchive::forget(const Eigen::AlignedBox3d& box) {
  note_changed(complete_());
  const auto note = [&](const Blocks& blocks) {
    for (const BlockKey& block : blocks) {
      const Eigen::Vector3d low = Eigen::Vector3d(block.x, block.y, block.z) * map_.block_size();
      if (box.intersects({low, (low.array() + map_.block_size()).matrix()})) noted_.insert(block);
    }
  };
  note(in_memory());
  for (const auto& [region, blocks] : stored_) note(blocks);
  seen_.forget(box);
  forgotten_.push_back(box);
}

/// A block on disk, without points that have been forgotten since it was written.
StoredParts MapArchive::stored_parts(const BlockKey& block) const {
  StoredParts parts = parts_of(folder_.read(block));
  for (const Eigen::AlignedBox3d& box : forgotten_)
    parts.seen = without_points(parts.seen, block, seen_.shift(), points_in(box, seen_.spacing()));
  return parts;
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
  forgotten_.clear();
  old_views_.clear();
  const std::vector<std::uint64_t> kept = views_.numbers();
  saved_views_ = {kept.begin(), kept.end()};
}

/// Blocks with surfels, or with seen points, be it only room for them; sorted.
MapArchive::Blocks MapArchive::in_memory() const {
  Blocks with_surfels;
  for (const auto& [block, pages] : map_.index().blocks()) with_surfels.push_back(block);
  std::sort(with_surfels.begin(), with_surfels.end());
  const Blocks seen = seen_.blocks();
  Blocks all;
  std::set_union(with_surfels.begin(), with_surfels.end(), seen.begin(), seen.end(), std::back_inserter(all));
  return all;
}

/// The blocks as the folder keeps them.
std::vector<StoredBlock> MapArchive::read(const Blocks& blocks) const {
  std::vector<StoredBlock> stored = map_.read_blocks(blocks);
  std::vector<std::vector<std::uint8_t>> seen = seen_.read_blocks(blocks);
  for (std::size_t n = 0; n < stored.size(); ++n) {
    StoredParts parts = {seen_.shift(), std::move(stored[n].second), std::move(seen[n])};
    if (is_stored(blocks[n])) {
      const StoredParts on_disk = stored_parts(blocks[n]);
      parts.surfels = on_disk.surfels;
      parts.seen = united(on_disk.seen, parts.seen);
    }
    stored[n].second = join(parts);
  }
  add_views(stored);
  return stored;
}

std::vector<std::uint8_t> MapArchive::united(const std::vector<std::uint8_t>& seen_a, const std::vector<std::uint8_t>& seen_b) const {
  return united_seen_blocks(seen_a, seen_b, static_cast<std::size_t>(seen_.bricks_of_block()));
}

/// Adds the views that are kept but not on disk, and erases those on disk that are no longer kept.
void MapArchive::add_views(std::vector<StoredBlock>& stored) const {
  if (!stores_views_) return;
  const std::vector<std::uint64_t> numbers = views_.numbers();
  const std::set<std::uint64_t> kept(numbers.begin(), numbers.end());
  for (const std::set<std::uint64_t>* on_disk : {&old_views_, &saved_views_})
    for (const std::uint64_t number : *on_disk)
      if (kept.count(number) == 0) stored.push_back({view_key(number), {}});
  for (const std::uint64_t number : numbers)
    if (saved_views_.count(number) == 0) stored.push_back({view_key(number), pack_view(views_.saved(number))});
}

std::vector<SavedView> MapArchive::stored_views(std::vector<std::string>* warnings) const {
  std::vector<SavedView> views;
  for (const std::uint64_t number : old_views_) {
    try {
      const std::vector<std::uint8_t> bytes = folder_.read(view_key(number));
      std::size_t used = 0;
      views.push_back(unpack_view(bytes.data(), bytes.size(), &used));
    } catch (const FileError&) {  // the map and the other views are worth having
    }
  }
  if (const std::size_t damaged = old_views_.size() - views.size(); damaged > 0)
    warnings->push_back("The map folder " + path_ + " has lost " + std::to_string(damaged) + " of its " +
                        std::to_string(old_views_.size()) +
                        " kept views, which cannot be read: what no other view has seen is unknown again; use a copy of the folder, or see "
                        "it again.");
  return views;
}

void MapArchive::add_stored(SavedMap& map) const {
  Blocks blocks;
  for (const auto& [region, some] : stored_) blocks.insert(blocks.end(), some.begin(), some.end());
  std::sort(blocks.begin(), blocks.end());
  std::map<BlockKey, std::vector<std::uint8_t>> seen;
  for (SeenSpace::Block& block : map.seen.blocks) seen[{block.block[0], block.block[1], block.block[2]}] = std::move(block.bytes);
  for (const BlockKey& block : blocks) {
    const StoredParts parts = stored_parts(block);
    const std::vector<Surfel> some = unpack_block(parts.surfels, block, map_.block_size());
    map.surfels.insert(map.surfels.end(), some.begin(), some.end());
    if (!parts.seen.empty()) seen[block] = united(parts.seen, seen[block]);
  }
  map.seen.blocks.clear();
  for (auto& [block, bytes] : seen) map.seen.blocks.push_back({{block.x, block.y, block.z}, std::move(bytes)});
}

void MapArchive::clear() {
  folder_.clear();
  stored_.clear();
  stored_surfels_ = 0;
  followed_.reset();
  noted_.clear();
  forgotten_.clear();
  fault_ = nullptr;
  saved_views_.clear();
  old_views_.clear();
  saved_ = next_try_ = 0;
}

}  // namespace frontier_surfels
