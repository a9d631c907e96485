#include "planner/cluster_lattice.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "planner/rounding.hpp"

namespace frontier_surfels {
namespace {

constexpr float kFarthest = 1e6F;     // [m] nothing is mapped beyond
constexpr float kLargestRadius = 10;  // [m]

/// A surfel stands for a face of the voxel that it was made in: half of that one's diagonal is its radius.
double area_of(float radius) {
  const double edge = radius / kNewRadius;
  return edge * edge;
}

/// Rounded towards zero, which is quick; what is taken away again is the same.
std::int64_t in_units(double value, double unit) { return static_cast<std::int64_t>(value * (1 / unit)); }

/// False for what is not finite.
bool within(const Eigen::Vector3f& v, float limit) {
  return std::abs(v.x()) <= limit && std::abs(v.y()) <= limit && std::abs(v.z()) <= limit;
}

}  // namespace

void ClusterLattice::apply(const Changes& changes) {
  check(changes);
  if (changes.since == 0) {
    pages_.clear();
    cubes_.clear();
    last_cube_ = {{}, nullptr};
    changed_.clear();
  }
  for (const std::uint32_t id : changes.removed) put(id, {});
  for (const Surfel& s : changes.updated) put(s.id, {s.position, s.normal, s.radius, s.label, nullptr});
}

void ClusterLattice::check(const Changes& changes) const {
  for (const Surfel& s : changes.updated) {
    if (!within(s.position, kFarthest) || !within(s.normal, 2) || !(s.radius > 0) || s.radius > kLargestRadius)
      throw Error("Surfel " + std::to_string(s.id) +
                  " cannot be clustered: its position, its normal or its radius is not finite, or far too large.");
  }
}

/// Nullptr if no surfel near this id was ever seen.
ClusterLattice::Kept* ClusterLattice::kept(std::uint32_t id) {
  const std::size_t page = id / kPage;
  return page < pages_.size() && pages_[page] ? &(*pages_[page])[id % kPage] : nullptr;
}

void ClusterLattice::put(std::uint32_t id, Kept now) {
  Kept* before = kept(id);
  if (before == nullptr) {
    if (now.radius == 0) return;
    const std::size_t page = id / kPage;
    if (page >= pages_.size()) pages_.resize(page + 1);
    pages_[page] = std::make_unique<Page>();
    before = kept(id);
  }
  const bool alike =
      before->label == now.label && before->radius == now.radius && before->position == now.position && before->normal == now.normal;
  if (alike) return;
  const BlockKey key = key_of(now.position);
  const bool same_cell = before->radius > 0 && before->cell->key == key;
  if (now.radius > 0) now.cell = same_cell ? before->cell : &cell_at(key);
  // Of an occupied surfel only its cell counts.
  if (!same_cell || now.radius == 0 || before->label == Label::kFrontier || now.label == Label::kFrontier) {
    if (before->radius > 0) count(*before, -1);
    if (now.radius > 0) count(now, 1);
  }
  *before = now;
}

void ClusterLattice::count(const Kept& surfel, std::int64_t sign) {
  ClusterCell& cell = *surfel.cell;
  if (!cell.changed) changed_.push_back(&cell);
  cell.changed = true;
  if (surfel.label == Label::kOccupied) {
    cell.occupied += static_cast<std::uint32_t>(sign);
    return;
  }
  const BlockKey& key = cell.key;
  cell.frontier += static_cast<std::uint32_t>(sign);
  cell.area += sign * in_units(area_of(surfel.radius), kAreaUnit);
  const int corner[] = {key.x, key.y, key.z};
  for (int axis = 0; axis < 3; ++axis) {
    cell.position[axis] += sign * in_units(surfel.position[axis] - corner[axis] * cell_, kLengthUnit);
    cell.normal[axis] += sign * in_units(surfel.normal[axis], kNormalUnit);
  }
}

/// Nullptr if there is none. The last one is tried first.
ClusterLattice::Cube* ClusterLattice::find_cube(const BlockKey& cube) {
  if (last_cube_.second != nullptr && last_cube_.first == cube) return last_cube_.second;
  const auto at = cubes_.find(cube);
  if (at == cubes_.end()) return nullptr;
  last_cube_ = {cube, &at->second};
  return &at->second;
}

ClusterCell* ClusterLattice::find(const BlockKey& key) {
  Cube* cube = find_cube(cube_of(key));
  return cube == nullptr ? nullptr : cube->cells[place_of(key)].get();
}

ClusterCell& ClusterLattice::cell_at(const BlockKey& key) {
  Cube* cube = find_cube(cube_of(key));
  if (cube == nullptr) cube = &cubes_[cube_of(key)];
  std::unique_ptr<ClusterCell>& cell = cube->cells[place_of(key)];
  if (!cell) {
    cell = std::make_unique<ClusterCell>();
    cell->key = key;
    ++cube->count;
    link(*cell);
  }
  return *cell;
}

void ClusterLattice::link(ClusterCell& cell) {
  for (int n = 0; n < 26; ++n) {
    const int place = n < 13 ? n : n + 1;  // of 27
    ClusterCell* other = find({cell.key.x + place / 9 - 1, cell.key.y + place / 3 % 3 - 1, cell.key.z + place % 3 - 1});
    cell.neighbours[n] = other;
    if (other != nullptr) other->neighbours[25 - n] = &cell;
  }
}

std::vector<ClusterCell*> ClusterLattice::take_changed() {
  std::vector<ClusterCell*> changed;
  changed.swap(changed_);
  std::sort(changed.begin(), changed.end(), [](const ClusterCell* a, const ClusterCell* b) { return a->key < b->key; });
  for (ClusterCell* cell : changed) cell->changed = false;
  return changed;
}

void ClusterLattice::forget_empty(const std::vector<ClusterCell*>& cells) {
  for (ClusterCell* cell : cells) {
    cell->was_occupied = cell->occupied > 0;
    if (cell->frontier > 0 || cell->occupied > 0) continue;
    for (int n = 0; n < 26; ++n)
      if (cell->neighbours[n] != nullptr) cell->neighbours[n]->neighbours[25 - n] = nullptr;
    const BlockKey key = cell->key;
    Cube* cube = find_cube(cube_of(key));
    cube->cells[place_of(key)].reset();
    if (--cube->count > 0) continue;
    last_cube_ = {{}, nullptr};
    cubes_.erase(cube_of(key));
  }
}

BlockKey ClusterLattice::key_of(const Eigen::Vector3f& position) const {
  return {round_down(position.x() * per_metre_), round_down(position.y() * per_metre_), round_down(position.z() * per_metre_)};
}

Eigen::Vector3d ClusterLattice::mean_position(const ClusterCell& cell) const {
  const Eigen::Vector3d corner = Eigen::Vector3d(cell.key.x, cell.key.y, cell.key.z) * cell_;
  const Eigen::Vector3d sum(cell.position[0], cell.position[1], cell.position[2]);
  return corner + sum * (kLengthUnit / std::max(1U, cell.frontier));
}

}  // namespace frontier_surfels
