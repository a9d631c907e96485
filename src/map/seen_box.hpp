/// The seen points in a box of the world.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "map/block_key.hpp"

namespace frontier_surfels {

/// Points of the lattice, counted along the axes from the world's origin: first, and one past the last along each axis.
struct PointRange {
  Eigen::Array3i first, end;

  /// The part of it in a brick, counted from the brick's first point; empty if first >= end along an axis.
  PointRange in_brick(const BlockKey& block, int shift, int brick) const;
  bool empty() const { return (first >= end).any(); }
};

/// @param box  [m]. @param spacing  of the lattice [m]
PointRange points_in(const Eigen::AlignedBox3d& box, double spacing);

/// What is remembered of a block (seen_block.hpp) without these points. @throws FileError  the bytes are damaged
std::vector<std::uint8_t> without_points(const std::vector<std::uint8_t>& bytes, const BlockKey& block, int shift,
                                         const PointRange& points);

}  // namespace frontier_surfels
