#include "planner/cluster_lattice.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "planner/rounding.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kAhead = 16;    // surfels between asking for memory and using it
constexpr float kFarthest = 1e6F;     // [m] nothing is mapped beyond
constexpr float kLargestRadius = 10;  // [m]

/// A surfel stands for a face of the voxel that it was made in: half of that one's diagonal is its radius.
double area_of(float radius) {
  const double edge = radius / kNewRadius;
  return edge * edge;
}

/// Rounded towards zero, which is quick; what is taken away again is the same.
std::int64_t in_units(double value, double unit) { return static_cast<std::int64_t>(value * (1 / unit)); }

/// Asks for the two cache lines of a surfel or cell that are going to be used.
template <typename T>
void prefetch(const T* at) {
  if (at == nullptr) return;
  __builtin_prefetch(at, 1);
  if (sizeof(T) > 64) __builtin_prefetch(reinterpret_cast<const char*>(at) + 64, 1);
}

/// False for what is not finite.
bool within(const Eigen::Vector3f& v, float limit) {
  return std::abs(v.x()) <= limit && std::abs(v.y()) <= limit && std::abs(v.z()) <= limit;
}

}  // namespace

// These are called for each surfel. They are inline because calls within a shared library go through a table.

inline BlockKey ClusterLattice::key_of(const Eigen::Vector3f& position) const {
  return {round_down(position.x() * per_metre_), round_down(position.y() * per_metre_), round_down(position.z() * per_metre_)};
}

/// Nullptr if no surfel near this id was ever seen.
inline ClusterLattice::Page* ClusterLattice::page_of(std::uint32_t id) {
  const std::size_t page = id / kPage;
  return page < pages_.size() ? pages_[page].get() : nullptr;
}

/// Nullptr if there is no surfel with this id.
inline ClusterLattice::Kept* ClusterLattice::kept(Page* page, std::uint32_t id) {
  return page != nullptr && (page->exists >> id % kPage & 1) != 0 ? &page->surfels[id % kPage] : nullptr;
}

/// Counts a surfel of a cell once more (1) or once less (-1).
inline void ClusterLattice::count(ClusterCell& cell, const Kept& surfel, std::int64_t sign) {
  if (!cell.changed) changed_.push_back(&cell);
  cell.changed = true;
  if (!surfel.is_frontier()) {
    cell.occupied += static_cast<std::uint32_t>(sign);
    return;
  }
  cell.frontier += static_cast<std::uint32_t>(sign);
  cell.area += sign * in_units(area_of(surfel.signed_radius), kAreaUnit);
  const std::array<double, 3> corner = {cell.key.x * cell_, cell.key.y * cell_, cell.key.z * cell_};
  for (int axis = 0; axis < 3; ++axis) {
    cell.position[axis] += sign * in_units(surfel.position[axis] - corner[axis], kLengthUnit);
    cell.normal[axis] += sign * in_units(surfel.normal[axis], kNormalUnit);
  }
}

/// @param cell  that `now` lies in
inline void ClusterLattice::change(const Kept& before, const Kept& now, ClusterCell& cell) {
  if (before.cell == now.cell && !before.is_frontier() && !now.is_frontier()) return;  // of an occupied surfel only its cell counts
  count(this->cell(before.cell), before, -1);
  count(cell, now, 1);
}

/// Nullptr if there is none. Those that were asked for before are tried first.
inline ClusterLattice::Cube* ClusterLattice::find_cube(const BlockKey& cube) {
  auto& [key, recent] = recent_cubes_[std::hash<BlockKey>()(cube) % kRecent];
  if (recent != nullptr && key == cube) return recent;
  const auto at = cubes_.find(cube);
  if (at == cubes_.end()) return nullptr;
  key = cube;
  recent = &at->second;
  return recent;
}

inline ClusterCell* ClusterLattice::find(const BlockKey& key) {
  const Cube* cube = find_cube(cube_of(key));
  const std::uint32_t number = cube == nullptr ? 0 : cube->cells[place_of(key)];
  return number == 0 ? nullptr : &cell(number);
}

void ClusterLattice::apply(const Changes& changes) {
  check(changes);
  if (changes.since == 0) {
    pages_.clear();
    cubes_.clear();
    recent_cubes_ = {};
    chunks_.clear();
    unused_.clear();
    changed_.clear();
  }
  remove(changes.removed);
  for (std::size_t n = 0; n < changes.updated.size(); n += kBatch) put(&changes.updated[n], std::min(kBatch, changes.updated.size() - n));
}

void ClusterLattice::check(const Changes& changes) const {
  for (const Surfel& s : changes.updated) {
    if (!within(s.position, kFarthest) || !within(s.normal, 2) || !(s.radius > 0) || s.radius > kLargestRadius)
      throw Error("Surfel " + std::to_string(s.id) +
                  " cannot be clustered: its position, its normal or its radius is not finite, or far too large.");
  }
}

void ClusterLattice::remove(const std::vector<std::uint32_t>& ids) {
  for (std::size_t n = 0; n < ids.size(); ++n) {
    // Memory is asked for what comes soon: first the surfel, then its cell.
    if (n + 2 * kAhead < ids.size())
      if (Page* page = page_of(ids[n + 2 * kAhead])) prefetch(&page->surfels[ids[n + 2 * kAhead] % kPage]);
    if (n + kAhead < ids.size()) {
      const Kept* next = kept(page_of(ids[n + kAhead]), ids[n + kAhead]);
      if (next != nullptr) prefetch(&cell(next->cell));
    }
    Page* page = page_of(ids[n]);
    const Kept* before = kept(page, ids[n]);
    if (before == nullptr) continue;
    count(cell(before->cell), *before, -1);
    page->exists &= ~(std::uint64_t{1} << ids[n] % kPage);
  }
}

/// @param count  at most kBatch
void ClusterLattice::put(const Surfel* surfels, std::size_t count) {
  std::array<ClusterCell*, kBatch> cells;
  for (std::size_t n = 0; n < count; ++n) {
    if (Page* page = page_of(surfels[n].id)) prefetch(&page->surfels[surfels[n].id % kPage]);
    keys_[n] = key_of(surfels[n].position);
  }
  for (std::size_t n = 0; n < count; ++n) {
    const bool as_before = n > 0 && keys_[n] == keys_[n - 1];
    cells[n] = as_before ? cells[n - 1] : find(keys_[n]);
    if (!as_before) prefetch(cells[n]);
  }
  for (std::size_t n = 0; n < count; ++n) {
    const Surfel& s = surfels[n];
    if (s.id / kPage >= pages_.size()) pages_.resize(s.id / kPage + 1);
    std::unique_ptr<Page>& page = pages_[s.id / kPage];
    if (!page) page = std::make_unique<Page>();
    Kept now = {{s.position.x(), s.position.y(), s.position.z()},
                {s.normal.x(), s.normal.y(), s.normal.z()},
                s.label == Label::kFrontier ? s.radius : -s.radius,
                0};
    const Kept* before = kept(page.get(), s.id);
    if (before != nullptr && before->looks_like(now)) continue;
    ClusterCell& cell = cells[n] != nullptr ? *cells[n] : cell_at(keys_[n]);
    now.cell = cell.number;
    if (before != nullptr)
      change(*before, now, cell);
    else
      this->count(cell, now, 1);
    page->surfels[s.id % kPage] = now;
    page->exists |= std::uint64_t{1} << s.id % kPage;
  }
}

ClusterCell& ClusterLattice::cell_at(const BlockKey& key) {
  Cube* found = find_cube(cube_of(key));
  Cube& cube = found != nullptr ? *found : cubes_[cube_of(key)];
  if (cube.cells[place_of(key)] != 0) return cell(cube.cells[place_of(key)]);
  const std::uint32_t number = take_number();
  ClusterCell& added = cell(number);
  added.key = key;
  added.number = number;
  cube.cells[place_of(key)] = number;
  ++cube.count;
  link(added);
  return added;
}

std::uint32_t ClusterLattice::take_number() {
  if (unused_.empty()) {
    const auto first = static_cast<std::uint32_t>(chunks_.size()) * kChunk;
    chunks_.push_back(std::make_unique<Chunk>());
    for (std::uint32_t n = kChunk; n-- > 0;)
      if (first + n > 0) unused_.push_back(first + n);
  }
  const std::uint32_t number = unused_.back();
  unused_.pop_back();
  return number;
}

void ClusterLattice::link(ClusterCell& cell) {
  // The cells around lie in up to two cubes along each axis: these are looked up once.
  const BlockKey low = cube_of({cell.key.x - 1, cell.key.y - 1, cell.key.z - 1});
  std::array<const Cube*, 8> cubes = {};
  std::array<bool, 8> known = {};
  BlockKey key;
  int n = 0;
  for (key.x = cell.key.x - 1; key.x <= cell.key.x + 1; ++key.x)
    for (key.y = cell.key.y - 1; key.y <= cell.key.y + 1; ++key.y)
      for (key.z = cell.key.z - 1; key.z <= cell.key.z + 1; ++key.z) {
        if (key == cell.key) continue;
        const BlockKey cube = cube_of(key);
        const int index = (cube.x - low.x) * 4 + (cube.y - low.y) * 2 + (cube.z - low.z);
        if (!known[index]) cubes[index] = find_cube(cube);
        known[index] = true;
        const std::uint32_t number = cubes[index] == nullptr ? 0 : cubes[index]->cells[place_of(key)];
        if (number != 0) {
          ClusterCell& other = this->cell(number);
          cell.neighbours[n] = &other;
          other.neighbours[25 - n] = &cell;
        }
        ++n;
      }
}

std::vector<ClusterCell*> ClusterLattice::take_changed() {
  for (ClusterCell* cell : changed_) cell->changed = false;
  return std::exchange(changed_, {});
}

void ClusterLattice::forget_empty(const std::vector<ClusterCell*>& cells) {
  for (ClusterCell* cell : cells) {
    cell->was_occupied = cell->occupied > 0;
    if (cell->frontier == 0 && cell->occupied == 0) forget(*cell);
  }
}

void ClusterLattice::forget(ClusterCell& cell) {
  for (int n = 0; n < 26; ++n)
    if (cell.neighbours[n] != nullptr) cell.neighbours[n]->neighbours[25 - n] = nullptr;
  const BlockKey key = cell.key, cube_key = cube_of(key);
  unused_.push_back(cell.number);
  cell = {};
  Cube* cube = find_cube(cube_key);
  cube->cells[place_of(key)] = 0;
  if (--cube->count > 0) return;
  recent_cubes_[std::hash<BlockKey>()(cube_key) % kRecent] = {};
  cubes_.erase(cube_key);
}

}  // namespace frontier_surfels
