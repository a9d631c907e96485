#include "frontier_surfels/planner/state_grid.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "config/config_text.hpp"
#include "planner/rounding.hpp"

namespace frontier_surfels {
namespace {

constexpr int kEdge = StateBlock::kEdge;
constexpr std::uint32_t kFirstMixed = 3;
constexpr std::int64_t kMostBlocks = std::int64_t{1} << 27;  // of the directory: 512 MiB
constexpr std::int32_t kFarthest = 1 << 24;                  // blocks from the origin

Eigen::Array3i to_cell(const std::array<std::int32_t, 3>& block) { return {block[0], block[1], block[2]}; }

/// Visits the numbers from `low` to `high`, those nearest to `begin` first: upwards, then downwards, each until a visit says that it is
/// far.
template <typename Visit>
void outwards(int begin, int low, int high, const Visit& visit) {
  if (low > high) return;
  begin = std::clamp(begin, low, high);
  for (int n = begin; n <= high && visit(n); ++n) {
  }
  for (int n = begin - 1; n >= low && visit(n); --n) {
  }
}

}  // namespace

StateGrid::StateGrid(double resolution) : resolution_(resolution), inverse_(1 / resolution) {
  if (!(resolution >= 0.02 && resolution <= 1))
    throw Error("The resolution of a grid of states is " + to_text(resolution) + " m: it must be from 0.02 to 1 m.");
}

bool StateGrid::apply(const StateChanges& changes) {
  check(changes);
  if (changes.since != 0 && changes.sequence <= sequence_) return true;
  if (changes.since > sequence_) return false;
  StateGrid begun(resolution_);  // what fails must leave the grid as it is
  StateGrid& grid = changes.since == 0 ? begun : *this;
  grid.make_room(changes.blocks);
  for (const StateBlock& block : changes.blocks) grid.set(block);
  if (changes.since == 0) *this = std::move(begun);
  sequence_ = changes.sequence;
  return true;
}

StateChanges StateGrid::take(StateChanges candidates) {
  check(candidates);
  StateChanges changed = {candidates.sequence, candidates.since, resolution_, {}};
  if (candidates.since == 0) {
    apply(candidates);
    changed.blocks = whole().blocks;
    return changed;
  }
  make_room(candidates.blocks);
  for (StateBlock& block : candidates.blocks) {
    if (get(block.block) == block) continue;
    set(block);
    changed.blocks.push_back(std::move(block));
  }
  sequence_ = candidates.sequence;
  return changed;
}

StateChanges StateGrid::whole() const {
  StateChanges all = {sequence_, 0, resolution_, {}};
  for (int x = 0; x < size_.x(); ++x)
    for (int y = 0; y < size_.y(); ++y)
      for (int z = 0; z < size_.z(); ++z) {
        const Cell block = low_ + Cell(x, y, z);
        if (entry(block) != 0) all.blocks.push_back(get({block.x(), block.y(), block.z()}));
      }
  return all;
}

std::pair<std::array<std::int32_t, 3>, std::array<std::int32_t, 3>> StateGrid::extent() const {
  const Cell high = low_ + size_ - 1;
  return {{low_.x(), low_.y(), low_.z()}, {high.x(), high.y(), high.z()}};
}

void StateGrid::check(const StateChanges& changes) const {
  if (std::abs(changes.resolution - resolution_) > 1e-9)
    throw Error("Changes of a grid of " + to_text(changes.resolution) + " m do not fit one of " + to_text(resolution_) + " m.");
  for (const StateBlock& block : changes.blocks) {
    const bool uniform = block.cells.size() == 1 && block.cells[0] < kFirstMixed;
    if (!uniform && block.cells.size() != StateBlock::kBytes)
      throw Error("A block of states has " + std::to_string(block.cells.size()) +
                  " bytes, or is of no known state: the changes are damaged.");
    for (const std::int32_t b : block.block)
      if (b < -kFarthest || b > kFarthest) throw Error("A block of states is absurdly far away: the changes are damaged.");
  }
}

/// Enlarges the directory so that it has these blocks.
void StateGrid::make_room(const std::vector<StateBlock>& blocks) {
  if (blocks.empty()) return;
  Cell low = low_, high = low_ + size_ - 1;
  if (directory_.empty()) low = high = to_cell(blocks.front().block);
  for (const StateBlock& block : blocks) {
    low = low.min(to_cell(block.block));
    high = high.max(to_cell(block.block));
  }
  if (!directory_.empty() && (low == low_).all() && (high == low_ + size_ - 1).all()) return;
  const Cell size = high - low + 1;
  if (size.cast<double>().prod() > static_cast<double>(kMostBlocks))
    throw Error("The grid of states would have " + std::to_string(size.x()) + " x " + std::to_string(size.y()) + " x " +
                std::to_string(size.z()) + " blocks: choose a larger resolution.");
  std::vector<std::uint32_t> larger(static_cast<std::size_t>(size.cast<std::int64_t>().prod()), 0);
  const Cell shift = low_ - low;
  for (int z = 0; z < size_.z(); ++z)
    for (int y = 0; y < size_.y(); ++y) {
      const auto from = directory_.begin() + (static_cast<std::ptrdiff_t>(z) * size_.y() + y) * size_.x();
      std::copy(from, from + size_.x(),
                larger.begin() + (static_cast<std::ptrdiff_t>(z + shift.z()) * size.y() + y + shift.y()) * size.x() + shift.x());
    }
  directory_ = std::move(larger);
  low_ = low;
  size_ = size;
}

/// What the directory says of a block; 0, unknown, beyond it.
inline std::uint32_t StateGrid::entry(const Cell& block) const {
  const int x = block.x() - low_.x(), y = block.y() - low_.y(), z = block.z() - low_.z();
  if (static_cast<unsigned>(x) >= static_cast<unsigned>(size_.x()) || static_cast<unsigned>(y) >= static_cast<unsigned>(size_.y()) ||
      static_cast<unsigned>(z) >= static_cast<unsigned>(size_.z()))
    return 0;
  return directory_[(static_cast<std::size_t>(z) * size_.y() + y) * size_.x() + x];
}

void StateGrid::set(const StateBlock& block) {
  const Cell at = to_cell(block.block) - low_;
  std::uint32_t& entry = directory_[(static_cast<std::size_t>(at.z()) * size_.y() + at.y()) * size_.x() + at.x()];
  if (block.cells.size() == 1) {
    if (entry >= kFirstMixed) unused_.push_back(entry - kFirstMixed);
    entry = block.cells[0];
    return;
  }
  if (entry < kFirstMixed) {
    if (unused_.empty()) {
      unused_.push_back(static_cast<std::uint32_t>(cells_.size()));
      cells_.emplace_back();
    }
    entry = kFirstMixed + unused_.back();
    unused_.pop_back();
  }
  Cells& cells = cells_[entry - kFirstMixed];
  for (int row = 0; row < kEdge * kEdge; ++row) {  // little endian, whatever this machine is
    const std::uint8_t *free = &block.cells[2 * row], *occupied = free + StateBlock::kBytes / 2;
    cells.free[row] = static_cast<Row>(free[0] | free[1] << 8);
    cells.occupied[row] = static_cast<Row>((occupied[0] | occupied[1] << 8) & ~cells.free[row]);
  }
}

StateBlock StateGrid::get(const std::array<std::int32_t, 3>& block) const {
  StateBlock copy = {block, {}};
  const std::uint32_t entry = this->entry(to_cell(block));
  if (entry < kFirstMixed) {
    copy.cells = {static_cast<std::uint8_t>(entry)};
    return copy;
  }
  copy.cells.resize(StateBlock::kBytes);
  const Cells& cells = cells_[entry - kFirstMixed];
  for (int row = 0; row < kEdge * kEdge; ++row) {
    std::uint8_t *free = &copy.cells[2 * row], *occupied = free + StateBlock::kBytes / 2;
    free[0] = static_cast<std::uint8_t>(cells.free[row]);
    free[1] = static_cast<std::uint8_t>(cells.free[row] >> 8);
    occupied[0] = static_cast<std::uint8_t>(cells.occupied[row]);
    occupied[1] = static_cast<std::uint8_t>(cells.occupied[row] >> 8);
  }
  return copy;
}

inline bool StateGrid::cell_of(const Eigen::Vector3f& point, Cell& cell) const {
  const double x = point.x() * inverse_, y = point.y() * inverse_, z = point.z() * inverse_;
  constexpr double kMost = static_cast<double>(kFarthest) * kEdge;
  if (!(std::abs(x) < kMost && std::abs(y) < kMost && std::abs(z) < kMost)) return false;
  cell = {round_down(x), round_down(y), round_down(z)};
  return true;
}

inline SpaceState StateGrid::cell_state(const Cell& cell) const {
  const std::uint32_t entry = this->entry({cell.x() >> 4, cell.y() >> 4, cell.z() >> 4});
  if (entry < kFirstMixed) return static_cast<SpaceState>(entry);
  const Cells& cells = cells_[entry - kFirstMixed];
  const int row = (cell.z() & 15) * kEdge + (cell.y() & 15), x = cell.x() & 15;
  return static_cast<SpaceState>((cells.free[row] >> x & 1) | (cells.occupied[row] >> x & 1) << 1);
}

SpaceState StateGrid::state(const Eigen::Vector3f& point_world) const {
  Cell cell;
  return cell_of(point_world, cell) ? cell_state(cell) : SpaceState::kUnknown;
}

std::vector<SpaceState> StateGrid::states(const std::vector<Eigen::Vector3f>& points_world) const {
  std::vector<SpaceState> states;
  states.reserve(points_world.size());
  for (const Eigen::Vector3f& point : points_world) states.push_back(state(point));
  return states;
}

/// The free, or the occupied, cells of a row of a block, a bit for each. @param y, z  of the row in the block
inline StateGrid::Row StateGrid::row_of(const Cell& block, int y, int z, bool free) const {
  const std::uint32_t entry = this->entry(block);
  if (entry >= kFirstMixed) {
    const Cells& cells = cells_[entry - kFirstMixed];
    return free ? cells.free[z * kEdge + y] : cells.occupied[z * kEdge + y];
  }
  return entry == static_cast<std::uint32_t>(free ? SpaceState::kFree : SpaceState::kOccupied) ? Row{0xffff} : Row{0};
}

/// Of all cells from `low` to `high`.
SpaceState StateGrid::range_state(const Cell& low, const Cell& high) const {
  bool unknown = false;
  for (int z = low.z(); z <= high.z(); ++z)
    for (int y = low.y(); y <= high.y(); ++y)
      for (int block = low.x() >> 4; block <= high.x() >> 4; ++block) {
        const int first = std::max(low.x() - block * kEdge, 0), last = std::min(high.x() - block * kEdge, kEdge - 1);
        const auto mask = static_cast<Row>((0xffff >> (kEdge - 1 - last + first)) << first);
        const Cell at = {block, y >> 4, z >> 4};
        if ((row_of(at, y & 15, z & 15, false) & mask) != 0) return SpaceState::kOccupied;
        unknown = unknown || (row_of(at, y & 15, z & 15, true) & mask) != mask;
      }
  return unknown ? SpaceState::kUnknown : SpaceState::kFree;
}

SpaceState StateGrid::box_state(const Eigen::AlignedBox3f& box_world) const {
  Cell low, high;
  if (box_world.isEmpty() || !cell_of(box_world.min(), low) || !cell_of(box_world.max(), high)) return SpaceState::kUnknown;
  return range_state(low, high);
}

/// Walks from cell to cell (Amanatides and Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987).
RayState StateGrid::ray_state(const Ray& ray_world, bool stop_at_unknown) const {
  const Eigen::Vector3d from = ray_world.from.cast<double>() * inverse_, way = ray_world.to.cast<double>() * inverse_ - from;
  Cell cell, end;
  if (!cell_of(ray_world.from, cell) || !cell_of(ray_world.to, end)) return {SpaceState::kUnknown, 0};
  const double length = way.norm() * resolution_;
  Eigen::Array3d next, across;  // where the ray enters the next cell along each axis, and how long it takes to cross one: shares of it
  for (int axis = 0; axis < 3; ++axis) {
    across[axis] = way[axis] != 0 ? 1 / std::abs(way[axis]) : HUGE_VAL;
    const double to_border = way[axis] > 0 ? cell[axis] + 1 - from[axis] : from[axis] - cell[axis];
    next[axis] = way[axis] != 0 ? to_border * across[axis] : HUGE_VAL;
  }
  const int cells = (end - cell).abs().sum();
  double at = 0;
  for (int n = 0;; ++n) {
    const SpaceState state = cell_state(cell);
    if (ends_ray(state, stop_at_unknown)) return {state, static_cast<float>(std::min(at, 1.0) * length)};
    if (n == cells) return {SpaceState::kFree, static_cast<float>(length)};
    int axis;
    at = next.minCoeff(&axis);
    cell[axis] += way[axis] > 0 ? 1 : -1;
    next[axis] += across[axis];
  }
}

RayState StateGrid::path_state(const Ray& path_world, const Eigen::Vector3f& box_size, bool stop_at_unknown) const {
  const Eigen::Vector3f way = path_world.to - path_world.from;
  const float length = way.norm();
  const Eigen::AlignedBox3f around(-box_size.cwiseAbs() / 2, box_size.cwiseAbs() / 2);
  const double wanted = std::ceil(2 * length * inverse_);
  if (!(wanted < 1e8)) return {SpaceState::kUnknown, 0};
  const int steps = std::max(1, static_cast<int>(wanted));
  Cell last_low = Cell::Zero(), last_high = Cell::Zero();
  for (int n = 0; n <= steps; ++n) {
    const Eigen::Vector3f at = path_world.from + way * (static_cast<float>(n) / static_cast<float>(steps));
    Cell low, high;
    if (!cell_of(at + around.min(), low) || !cell_of(at + around.max(), high)) return {SpaceState::kUnknown, 0};
    const bool same = n > 0 && (low == last_low).all() && (high == last_high).all();
    last_low = low;
    last_high = high;
    if (same) continue;
    const SpaceState state = range_state(low, high);
    if (ends_ray(state, stop_at_unknown)) return {state, (at - path_world.from).norm()};
  }
  return {SpaceState::kFree, length};
}

/// The nearest cell that is not free, or is free, within `most` [m] of a point, and its distance; `most` and the point's own cell if there
/// is none. Nearer blocks go first, and in them nearer rows: what is farther than the best cell so far is left out.
std::pair<float, StateGrid::Cell> StateGrid::nearest(const Eigen::Vector3f& point, float most, bool free) const {
  Cell own;
  if (!cell_of(point, own)) return {most, Cell::Zero()};
  const Eigen::Array3d p = point.cast<double>().array() * inverse_;
  double best = most * inverse_ * (most * inverse_);
  Cell found = own;
  const auto squared = [&](int axis, int low, int high) {  // distance to the layers of cells from `low` to below `high`
    const double d = std::max({0.0, low - p[axis], p[axis] - high});
    return d * d;
  };
  const auto visit_row = [&](Row row, int x, int y, int z, double yz2) {  // x: of the row's first cell
    const int middle = std::clamp(own.x() - x, 0, kEdge - 1);
    const unsigned above = row >> middle, below = row & ((2U << middle) - 1);
    const auto take = [&](int cell) {
      const double d2 = yz2 + squared(0, cell, cell + 1);
      if (d2 >= best) return;
      best = d2;
      found = {cell, y, z};
    };
    if (above != 0) take(x + middle + __builtin_ctz(above));
    if (below != 0) take(x + 31 - __builtin_clz(below));
  };
  const auto visit_block = [&](const Cell& block) {
    const std::uint32_t entry = this->entry(block);
    const bool mixed = entry >= kFirstMixed;
    if (!mixed && (entry == static_cast<std::uint32_t>(SpaceState::kFree)) != free) return;
    const Cell low = block * kEdge, high = low + kEdge - 1;
    outwards(own.z(), low.z(), high.z(), [&](int z) {
      const double z2 = squared(2, z, z + 1);
      if (z2 >= best) return false;
      const int wide = static_cast<int>(std::sqrt(best - z2)) + 1;
      outwards(own.y(), std::max(low.y(), own.y() - wide), std::min(high.y(), own.y() + wide), [&](int y) {
        const Row row = mixed ? cells_[entry - kFirstMixed].free[(z & 15) * kEdge + (y & 15)] : Row{0xffff};
        const Row wanted = mixed && !free ? static_cast<Row>(~row) : row;
        if (wanted != 0) visit_row(wanted, low.x(), y, z, z2 + squared(1, y, y + 1));
        return true;
      });
      return true;
    });
  };
  // Beyond the blocks of the directory all is unknown: one layer of them is as good as all.
  const int reach = static_cast<int>(std::min(most * inverse_, 1e6)) + 1;
  const auto to_block = [](int cell) { return cell >> 4; };
  const Cell first = (own - reach).unaryExpr(to_block).max(low_ - 1), last = (own + reach).unaryExpr(to_block).min(low_ + size_);
  const auto block_squared = [&](int axis, int block) { return squared(axis, block * kEdge, (block + 1) * kEdge); };
  outwards(own.z() >> 4, first.z(), last.z(), [&](int z) {
    const double z2 = block_squared(2, z);
    if (z2 >= best) return false;
    outwards(own.y() >> 4, first.y(), last.y(), [&](int y) {
      const double yz2 = z2 + block_squared(1, y);
      if (yz2 >= best) return false;
      outwards(own.x() >> 4, first.x(), last.x(), [&](int x) {
        if (yz2 + block_squared(0, x) >= best) return false;
        visit_block({x, y, z});
        return true;
      });
      return true;
    });
    return true;
  });
  return {static_cast<float>(std::sqrt(best) * resolution_), found};
}

float StateGrid::clearance(const Eigen::Vector3f& point_world, float most) const {
  if (!(most > 0) || state(point_world) != SpaceState::kFree) return 0;
  return std::min(nearest(point_world, most, false).first, most);
}

NearestBoundary StateGrid::nearest_boundary(const Eigen::Vector3f& point_world, float reach) const {
  NearestBoundary boundary;
  if (!(reach > 0) || !point_world.allFinite()) return boundary;
  const SpaceState own = state(point_world);
  const auto [distance, cell] = nearest(point_world, reach, own != SpaceState::kFree);
  if (distance >= reach) return boundary;
  boundary.distance = distance;
  boundary.in_front = own == SpaceState::kFree;
  boundary.label = (boundary.in_front ? cell_state(cell) : own) == SpaceState::kOccupied ? Label::kOccupied : Label::kFrontier;
  return boundary;
}

}  // namespace frontier_surfels
