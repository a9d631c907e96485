/// A grid of states of the world, small enough to be sent and fast enough to be asked millions of times a second: what a planner needs in
/// its own process. Mapper::state_changes() fills it, MapClient follows it.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "frontier_surfels/planner/states.hpp"

namespace frontier_surfels {

/// A cube of 16^3 cells; the cell (x, y, z) of block (X, Y, Z) begins at (16 (X, Y, Z) + (x, y, z)) * resolution.
struct StateBlock {
  static constexpr int kEdge = 16;
  static constexpr int kCells = kEdge * kEdge * kEdge;
  static constexpr std::size_t kBytes = kCells / 4;

  std::array<std::int32_t, 3> block = {0, 0, 0};

  /// One byte: the state of all cells. Or kBytes: a bit for each cell that is free, then a bit for each cell that is occupied; x runs
  /// fastest, and a byte's lowest bit comes first.
  std::vector<std::uint8_t> cells;

  /// @param cell  x + 16 y + 256 z
  SpaceState state(int cell) const {
    if (cells.size() == 1) return static_cast<SpaceState>(cells[0]);
    const std::size_t byte = static_cast<std::size_t>(cell) / 8;
    const int bit = cell % 8;
    if ((cells[byte] >> bit & 1) != 0) return SpaceState::kFree;
    return (cells[kBytes / 2 + byte] >> bit & 1) != 0 ? SpaceState::kOccupied : SpaceState::kUnknown;
  }
};

inline bool operator==(const StateBlock& a, const StateBlock& b) { return a.block == b.block && a.cells == b.cells; }

/// Blocks of a grid that are different from an earlier one.
struct StateChanges {
  std::uint64_t sequence = 0;      ///< number of the map now
  std::uint64_t since = 0;         ///< number of the earlier map; 0: this is the whole grid, forget everything else
  double resolution = 0;           ///< edge of a cell [m]
  std::vector<StateBlock> blocks;  ///< what no block covers is unknown
};

/// Answers for points, rays, boxes and paths of the world [m]. A cell is free if all of it is: no surfel passes through it, and its centre
/// is free; it is occupied if an occupied surfel passes through it. Points that are not finite, or beyond the grid, are unknown.
/// Calls that do not change the grid may come from several threads at once.
class StateGrid {
 public:
  /// @param resolution  edge of a cell [m]. @throws Error  it is not from 0.02 to 1 m
  explicit StateGrid(double resolution);

  double resolution() const { return resolution_; }
  std::uint64_t sequence() const { return sequence_; }  ///< of what was applied last; 0: the grid is empty

  /// Takes changes over, by the rules of StatesUpdate.msg. Old ones are left out.
  /// @return false  changes are missing between the grid's number and these, and nothing was done: ask for the whole grid
  /// @throws Error  the changes are damaged, of another resolution, or blocks are absurdly far from each other; the grid is as before
  bool apply(const StateChanges& changes);

  /// Takes over the blocks that may have changed. @return those that have
  /// @throws Error  as apply()
  StateChanges take(StateChanges candidates);

  /// All blocks that are not unknown as a whole, sorted.
  StateChanges whole() const;

  SpaceState state(const Eigen::Vector3f& point_world) const;
  std::vector<SpaceState> states(const std::vector<Eigen::Vector3f>& points_world) const;

  /// Where a ray ends: at the first cell on its way that is occupied, or unknown if that is asked for.
  RayState ray_state(const Ray& ray_world, bool stop_at_unknown) const;

  /// Occupied if one of the cells is that the box touches, else unknown if one is, else free.
  SpaceState box_state(const Eigen::AlignedBox3f& box_world) const;

  /// Where a box stops that is moved with its centre along a path, in steps of half a cell. The distance is that of its centre.
  RayState path_state(const Ray& path_world, const Eigen::Vector3f& box_size, bool stop_at_unknown) const;

  /// Distance from a point to the nearest cell that is not free, at most `most` [m]; 0 if its own cell is not free.
  float clearance(const Eigen::Vector3f& point_world, float most) const;

  /// The nearest place where free cells end: in_front says that the point's own cell is free. The label is that of the nearest cell that is
  /// not free, or of its own if that is not free. There is no id.
  NearestBoundary nearest_boundary(const Eigen::Vector3f& point_world, float reach) const;

  /// The corner blocks of all that the grid covers: from the lowest to the highest; high < low if it is empty.
  std::pair<std::array<std::int32_t, 3>, std::array<std::int32_t, 3>> extent() const;

 private:
  using Row = std::uint16_t;  // 16 cells along x, a bit for each
  struct Cells {
    std::array<Row, 256> free, occupied;  // [z][y]
  };
  using Cell = Eigen::Array3i;

  void check(const StateChanges& changes) const;
  void set(const StateBlock& block);
  StateBlock get(const std::array<std::int32_t, 3>& block) const;
  void make_room(const std::vector<StateBlock>& blocks);
  std::uint32_t entry(const Cell& block) const;
  SpaceState cell_state(const Cell& cell) const;
  Row row_of(const Cell& block, int y, int z, bool free) const;
  SpaceState range_state(const Cell& low, const Cell& high) const;
  bool cell_of(const Eigen::Vector3f& point, Cell& cell) const;
  std::pair<float, Cell> nearest(const Eigen::Vector3f& point, float most, bool free) const;

  double resolution_, inverse_;
  std::uint64_t sequence_ = 0;
  Cell low_ = Cell::Zero(), size_ = Cell::Zero();  ///< the directory's lowest block, and its blocks along each axis
  std::vector<std::uint32_t> directory_;           ///< [z][y][x] a state, or 3 + a number in cells_
  std::vector<Cells> cells_;
  std::vector<std::uint32_t> unused_;  ///< numbers in cells_
};

}  // namespace frontier_surfels
