#include "ros/output/surfel_markers.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

constexpr double kCellsPerMetre = 256;           // so that a block of 2^7 cells is 0.5 m wide
constexpr std::uint32_t kLatticeSize = 1 << 24;  // 65 km; surfels outside of it belong to its outermost cells
constexpr std::uint32_t kOrigin = 0x555555;      // cell of the world's origin: far from the corners of blocks of every size
constexpr char const* kNamespaces[] = {"frontier", "occupied"};

int namespace_of(Label label) { return label == Label::kOccupied ? 1 : 0; }

std::uint64_t lattice(float metres) {
  const double cell = metres * kCellsPerMetre + kOrigin;
  return cell > 0 ? static_cast<std::uint64_t>(std::min<double>(cell, kLatticeSize - 1)) : 0;  // also 0 for NaN
}

/// Puts two zeros between every two of the lowest 21 bits.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 32) & 0x001f00000000ffff;
  bits = (bits | bits << 16) & 0x001f0000ff0000ff;
  bits = (bits | bits << 8) & 0x100f00f00f00f00f;
  bits = (bits | bits << 4) & 0x10c30c30c30c30c3;
  return (bits | bits << 2) & 0x1249249249249249;
}

/// The direction that is nearest to the normal: twice the axis, plus one if the normal points the other way (0 ... 5).
std::uint64_t direction(const Eigen::Vector3f& normal) {
  int axis;
  normal.cwiseAbs().maxCoeff(&axis);
  return static_cast<std::uint64_t>(2 * axis + (normal[axis] < 0));
}

int highest_bit(std::uint64_t bits) { return 63 - __builtin_clzll(bits); }

}  // namespace

SurfelMarkers::Key SurfelMarkers::block_key(const Surfel& surfel) const {
  const Eigen::Vector3f& p = surfel.position;
  return lattice(p.x()) >> shift_ << 40 | lattice(p.y()) >> shift_ << 20 | lattice(p.z()) >> shift_;  // at most 17 bits each
}

/// Label, direction of the normal, and Morton number of the cell within the block.
SurfelMarkers::Key SurfelMarkers::cell_key(const Surfel& surfel) const {
  const Eigen::Vector3f& p = surfel.position;
  const std::uint64_t within = (std::uint64_t{1} << shift_) - 1;
  const Key cell = spread(lattice(p.x()) & within) << 2 | spread(lattice(p.y()) & within) << 1 | spread(lattice(p.z()) & within);
  return static_cast<Key>(namespace_of(surfel.label)) << 63 | direction(surfel.normal) << 60 | cell;
}

SurfelMarkers::Block& SurfelMarkers::touched_block(Key key) {
  const auto [found, is_new] = blocks_.try_emplace(key);
  Block& block = found->second;
  if (is_new) block.number = next_number_++;
  if (!block.touched) {
    block.touched = true;
    touched_.push_back(key);
  }
  return block;
}

void SurfelMarkers::touch(const Surfel& surfel, bool comes) {
  if (!indexed_) return;
  Block& block = touched_block(block_key(surfel));
  if (!comes) return;                              // refresh() finds out that the surfel is gone
  if (block.ids.size() == block.ids.capacity()) {  // surfels that change often must not pile up until the next update
    std::sort(block.ids.begin(), block.ids.end());
    block.ids.erase(std::unique(block.ids.begin(), block.ids.end()), block.ids.end());
    if (2 * block.ids.size() >= block.ids.capacity()) block.ids.reserve(2 * block.ids.capacity() + 1);
  }
  block.ids.push_back(surfel.id);
}

void SurfelMarkers::forget() {
  blocks_ = {};
  touched_ = {};
  scratch_ = {};
  indexed_ = false;
}

void SurfelMarkers::index(const SurfelSlots& slots) {
  blocks_.clear();
  touched_.clear();
  next_number_ = 0;
  for (const Surfel& surfel : slots) touched_block(block_key(surfel)).ids.push_back(surfel.id);
  indexed_ = true;
}

/// Orders the surfels of a block by cell, removes those that are gone, and counts the squares on every level.
void SurfelMarkers::refresh(Key key, Block& block, const SurfelSlots& slots) {
  scratch_.clear();
  for (const std::uint32_t id : block.ids) {
    const Surfel* surfel = slots.find(id);
    if (surfel != nullptr && block_key(*surfel) == key) scratch_.emplace_back(cell_key(*surfel), id);
  }
  std::sort(scratch_.begin(), scratch_.end());
  scratch_.erase(std::unique(scratch_.begin(), scratch_.end()), scratch_.end());

  block.ids.resize(scratch_.size());
  block.begins.resize(scratch_.size());
  block.squares.fill(0);
  for (std::size_t i = 0; i < scratch_.size(); ++i) {
    // The cube on level n >= 1 is the key without its last 3 (n - 1) bits.
    const Key difference = i == 0 ? ~Key{0} : scratch_[i].first ^ scratch_[i - 1].first;
    const int level = difference == 0 ? 0 : std::min(highest_bit(difference) / 3 + 1, kLevels - 1);
    block.ids[i] = scratch_[i].second;
    block.begins[i] = static_cast<std::uint8_t>(level);
    ++block.squares[level];
  }
  for (int level = kLevels - 1; level > 0; --level) block.squares[level - 1] += block.squares[level];
  block.touched = false;
}

std::size_t SurfelMarkers::total(int level) const {
  std::size_t total = 0;
  for (const auto& [key, block] : blocks_) total += block.squares[level];
  return total;
}

/// The finest level that keeps the limit. A level finer than the present one must leave room to spare, because everything is sent again
/// when the level changes.
int SurfelMarkers::fitting_level() const {
  const int coarsest = shift_ + 1;  // of blocks of this size
  for (int level = 0; level <= coarsest; ++level)
    if (total(level) <= (level < level_ ? limit_ / 4 * 3 : limit_)) return level;
  return std::min(coarsest + 1, kLevels - 1);
}

/// Brings all touched blocks up to date and chooses the level. @return whether the level has changed
bool SurfelMarkers::settle_level(const SurfelSlots& slots) {
  for (bool changed = false;; changed = true) {
    for (const Key key : touched_) {
      Block& block = blocks_.at(key);
      if (block.touched) refresh(key, block, slots);
    }
    const int level = fitting_level();
    if (level == level_) return changed;
    level_ = level;
    const int shift = std::max(kBlockShift, level - 1);
    if (shift == shift_) continue;
    shift_ = shift;
    index(slots);
  }
}

std::array<MarkerSquares, 2> SurfelMarkers::squares_of(const Block& block, const SurfelSlots& slots) const {
  std::array<MarkerSquares, 2> squares;
  const auto add = [&](const Surfel& surfel) { squares[namespace_of(surfel.label)].add(surfel); };
  if (level_ == 0) {
    for (const std::uint32_t id : block.ids) add(*slots.find(id));
    return squares;
  }
  MergedSurfels merged;
  for (std::size_t i = 0; i < block.ids.size(); ++i) {
    if (i > 0 && block.begins[i] >= level_) {
      add(merged.mean(cell() / 2));
      merged = MergedSurfels();
    }
    merged.add(*slots.find(block.ids[i]));
  }
  if (!block.ids.empty()) add(merged.mean(cell() / 2));
  return squares;
}

void SurfelMarkers::send(Block& block, const SurfelSlots& slots, const std_msgs::Header& header, visualization_msgs::MarkerArray& message) {
  std::array<MarkerSquares, 2> squares = squares_of(block, slots);
  for (std::size_t label = 0; label < squares.size(); ++label) {
    const bool wanted = !squares[label].points.empty();
    if (wanted) {
      message.markers.push_back(marker(header, kNamespaces[label], block.number, visualization_msgs::Marker::TRIANGLE_LIST));
      message.markers.back().points = std::move(squares[label].points);
      message.markers.back().colors = std::move(squares[label].colors);
    } else if (block.shown[label]) {
      message.markers.push_back(deletion(header, kNamespaces[label], block.number));
    }
    block.shown[label] = wanted;
  }
}

visualization_msgs::MarkerArray SurfelMarkers::update(const SurfelMirror& map, const std::optional<CameraView>& camera,
                                                      const ros::Time& stamp, bool all) {
  all = all || !indexed_;
  if (!indexed_) index(map.slots());
  all = settle_level(map.slots()) || all;

  visualization_msgs::MarkerArray message;
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = world_frame_;
  if (all) {
    message.markers.push_back(deletion_of_all(header));
    touched_.clear();
    for (auto& [key, block] : blocks_) {
      touched_.push_back(key);
      block.shown = {};
    }
  }
  std::sort(touched_.begin(), touched_.end());
  for (const Key key : touched_) {
    const auto found = blocks_.find(key);
    send(found->second, map.slots(), header, message);
    if (found->second.ids.empty()) blocks_.erase(found);
  }
  touched_.clear();

  const bool camera_known = camera && camera->known();
  if (camera_known) message.markers.push_back(view_pyramid(header, *camera));
  if (!camera_known && camera_shown_ && !all) message.markers.push_back(deletion(header, "camera", 0));
  camera_shown_ = camera_known;
  message.markers.push_back(counts_text(header, camera_known ? &*camera : nullptr, map.occupied(), map.size() - map.occupied()));
  return message;
}

std::size_t SurfelMarkers::squares() const { return total(level_); }

double SurfelMarkers::cell() const { return level_ == 0 ? 0 : std::ldexp(1 / kCellsPerMetre, level_ - 1); }

}  // namespace frontier_surfels
