/// Worlds of boxes as a StateGrid, and slow, obvious ways through them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "frontier_surfels/planner/ways.hpp"

namespace frontier_surfels {

constexpr double kCell = 0.05;  // [m]
constexpr float kNoWay = std::numeric_limits<float>::infinity();
using Index = std::array<int, 3>;

/// A box of cells, unknown at first; what is outside stays unknown.
class CellBox {
 public:
  CellBox(const Index& low, const Index& size) : low_(low), size_(size), cells_(size[0] * size[1] * size[2], SpaceState::kUnknown) {}

  SpaceState at(const Index& cell) const { return contains(cell) ? cells_[number(cell)] : SpaceState::kUnknown; }

  /// The cells from `low` to below `high`, as far as they are in the box.
  void fill(const Index& low, const Index& high, SpaceState state) {
    for (int z = low[2]; z < high[2]; ++z)
      for (int y = low[1]; y < high[1]; ++y)
        for (int x = low[0]; x < high[0]; ++x)
          if (contains({x, y, z})) cells_[number({x, y, z})] = state;
  }
  void fill(SpaceState state) { std::fill(cells_.begin(), cells_.end(), state); }

  StateChanges changes() const {
    constexpr int kEdge = StateBlock::kEdge;
    std::map<Index, StateBlock> blocks;
    for (int z = low_[2]; z < low_[2] + size_[2]; ++z)
      for (int y = low_[1]; y < low_[1] + size_[1]; ++y)
        for (int x = low_[0]; x < low_[0] + size_[0]; ++x) {
          const SpaceState state = at({x, y, z});
          if (state == SpaceState::kUnknown) continue;
          const Index block = {x >> 4, y >> 4, z >> 4};
          StateBlock& made = blocks.try_emplace(block, StateBlock{block, std::vector<std::uint8_t>(StateBlock::kBytes, 0)}).first->second;
          const int n = (x & 15) + kEdge * (y & 15) + kEdge * kEdge * (z & 15);
          made.cells[(state == SpaceState::kFree ? 0 : StateBlock::kBytes / 2) + n / 8] |= static_cast<std::uint8_t>(1 << n % 8);
        }
    StateChanges changes = {1, 0, kCell, {}};
    for (const auto& [block, made] : blocks) changes.blocks.push_back(made);
    return changes;
  }

  StateGrid grid() const {
    StateGrid grid(kCell);
    grid.apply(changes());
    return grid;
  }

 private:
  bool contains(const Index& cell) const {
    for (int axis = 0; axis < 3; ++axis)
      if (cell[axis] < low_[axis] || cell[axis] >= low_[axis] + size_[axis]) return false;
    return true;
  }
  std::size_t number(const Index& cell) const {
    return static_cast<std::size_t>((cell[2] - low_[2]) * size_[1] + cell[1] - low_[1]) * size_[0] + cell[0] - low_[0];
  }

  Index low_, size_;
  std::vector<SpaceState> cells_;
};

/// Ways by relaxation until nothing changes, over the same lattice.
class SlowWays {
 public:
  /// @param from     a place of the lattice; if it is closed, then no wall may be between it and its neighbours: that is not looked at
  /// @param low      the lattice's first place here ...
  /// @param high     ... and its last
  SlowWays(const CellBox& box, const Index& from, const WayOptions& options, const Index& low, const Index& high)
      : box_(box), options_(options) {
    for (int z = low[2]; z <= high[2]; ++z)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int x = low[0]; x <= high[0]; ++x)
          if (is_open(at({x, y, z}).cast<double>())) lengths_[{x, y, z}] = kNoWay;
    leave_ = from;
    leaves_closed_ = lengths_.count(from) == 0;
    lengths_[from] = 0;
    while (relax()) {
    }
  }

  /// [m]
  double length(const Index& place) const {
    const auto found = lengths_.find(place);
    return found == lengths_.end() ? kNoWay : found->second;
  }
  const std::map<Index, double>& lengths() const { return lengths_; }
  Eigen::Vector3f at(const Index& place) const {
    return (Eigen::Array3d(place[0], place[1], place[2]) * options_.lattice).matrix().cast<float>();
  }

  bool is_open(const Eigen::Vector3d& p) const {
    return p.z() >= options_.lowest - 1e-6 && p.z() <= options_.highest + 1e-6 && (is_free(p, options_.radius) || is_own_room(p));
  }

  /// Is a ball free, by all cells that it touches?
  bool is_free(const Eigen::Vector3d& p, double radius) const {
    Index low, high;
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = static_cast<int>(std::floor((p[axis] - radius) / kCell));
      high[axis] = static_cast<int>(std::floor((p[axis] + radius) / kCell));
    }
    for (int x = low[0]; x <= high[0]; ++x)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int z = low[2]; z <= high[2]; ++z) {
          const Eigen::Vector3d corner = kCell * Eigen::Vector3d(x, y, z);
          if (distance(p, corner) < radius && box_.at({x, y, z}) != SpaceState::kFree) return false;
        }
    return true;
  }

 private:
  static double distance(const Eigen::Vector3d& p, const Eigen::Vector3d& corner) {
    return (corner - p).cwiseMax(p - corner - Eigen::Vector3d::Constant(kCell)).cwiseMax(0).norm();
  }
  /// Near a place where the robot has been, the box around the ball may be unknown.
  bool is_own_room(const Eigen::Vector3d& p) const {
    const auto near = [&](const Eigen::Vector3f& b) { return (b.cast<double>() - p).norm() <= options_.own_room; };
    if (std::none_of(options_.been.begin(), options_.been.end(), near)) return false;
    const auto cell = [&](double x) { return static_cast<int>(std::floor(x / kCell)); };
    const double r = options_.radius;
    for (int x = cell(p.x() - r); x <= cell(p.x() + r); ++x)
      for (int y = cell(p.y() - r); y <= cell(p.y() + r); ++y)
        for (int z = cell(p.z() - r); z <= cell(p.z() + r); ++z)
          if (box_.at({x, y, z}) == SpaceState::kOccupied) return false;
    return true;
  }
  /// Balls that do not overlap are not enough: then there must be one in between, at least every radius. The start need not be open.
  bool is_step(const Index& from, const Index& to) const {
    if (leaves_closed_ && from == leave_) return true;
    const Eigen::Vector3d a = at(from).cast<double>(), b = at(to).cast<double>();
    if ((b - a).norm() < 2 * options_.radius) return true;
    const int steps = static_cast<int>(std::ceil((b - a).norm() / std::clamp(options_.radius, kCell / 2, 2 * kCell)));
    for (int n = 1; n < steps; ++n)
      if (!is_open(a + (b - a) * n / steps)) return false;
    return true;
  }
  bool relax() {
    bool changed = false;
    for (auto& [place, length] : lengths_)
      for (int n = 0; n < 27; ++n) {
        const Index step = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
        const auto other = lengths_.find({place[0] + step[0], place[1] + step[1], place[2] + step[2]});
        if (other == lengths_.end()) continue;
        const double there = other->second + options_.lattice * Eigen::Vector3d(step[0], step[1], step[2]).norm();
        if (there >= length - 1e-9 || !is_step(other->first, place)) continue;
        length = there;
        changed = true;
      }
    return changed;
  }

  const CellBox& box_;
  const WayOptions options_;
  Index leave_;  ///< the start
  bool leaves_closed_ = false;
  std::map<Index, double> lengths_;  ///< of the open places
};

}  // namespace frontier_surfels
