#include "map/map_window.hpp"

#include <algorithm>
#include <cmath>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

constexpr double kMostCells = 1 << 20;  // a grid of 24 blocks' range and 150 degrees of view has fewer

/// The tangents of the grid's borders, seen from the camera: low and high along i, low and high along j.
Eigen::Vector4d border_slopes(const Grid& g) {
  return {(-0.5 - g.center_i) / g.fx, (g.size_i - 0.5 - g.center_i) / g.fx, (-0.5 - g.center_j) / g.fy,
          (g.size_j - 0.5 - g.center_j) / g.fy};
}

/// Depth at which the grid ends [m].
double far_end(const Grid& g) { return g.z_min * std::exp((g.size_k - g.k_min) / g.f); }

/// An axis of the grid's cross-section.
struct Axis {
  double f, center, size;  ///< [pixel], [voxel], [voxel]
};

/// Is no surfel of a box in view along an axis? Where i = f x / m + center is a surfel's place, m being its depth but at least z_min, it is
/// beside the grid if i <= -reach (1 + |x| / m), or as far beyond the other end. Times m both are half spaces, or two, before m >= z_min.
/// @param x, z  of the box's corners, camera frame [m];  reach  the largest of a surfel there [voxel]
bool is_beside(const Axis& axis, const Eigen::Array<double, 8, 1>& x, const Eigen::Array<double, 8, 1>& z, double z_min, double reach) {
  const Eigen::Array<double, 8, 1> m = z.max(z_min), at = axis.f * x + axis.center * m, beyond = reach * (m + x.abs());
  const bool bent = z.minCoeff() < z_min;  // then only a border that bends outwards bounds what is convex
  const bool low = (at <= -beyond).all() && (!bent || axis.center + reach >= 0),
             high = (at - axis.size * m >= beyond).all() && (!bent || axis.size + reach - axis.center >= 0);
  return low || high;
}

}  // namespace

double grid_reach(const Grid& grid) {
  const Eigen::Array4d slopes = border_slopes(grid).array().square();
  return far_end(grid) * std::sqrt(1 + slopes.head<2>().maxCoeff() + slopes.tail<2>().maxCoeff());
}

double block_size_for(double z_max) {
  double size = 0.5;
  while (z_max > 24 * size) size *= 2;
  return size;
}

MapWindow::MapWindow(const Grid& grid, const Eigen::Isometry3d& T_world_camera, double block_size, double margin,
                     const SurfelExtent& extent)
    : grid_(grid), extent_(extent), z_far_(far_end(grid)) {
  // Between the grid's two ends its cross-section lies within that of their convex hull.
  const Eigen::Vector4d slopes = border_slopes(grid);
  Eigen::AlignedBox3d box;
  for (const auto& [z, scale] :
       {std::make_pair(-(grid.padding_k + 0.5) * grid.delta_min, double{grid.z_min}), std::make_pair(z_far_, z_far_)})
    for (const double i : {slopes[0], slopes[1]})
      for (const double j : {slopes[2], slopes[3]}) box.extend(T_world_camera * Eigen::Vector3d(i * scale, j * scale, z));
  const Eigen::Vector3d low = ((box.min().array() - margin) / block_size).floor(),
                        high = ((box.max().array() + margin) / block_size).floor();
  const Eigen::Vector3d size = high - low + Eigen::Vector3d::Ones();
  if (!(size.prod() < kMostCells))
    throw BadFrame("The view's grid would be " + std::to_string(size.maxCoeff() * block_size) + " m large, too much for a range of " +
                   std::to_string(grid.z_max) + " m; check the intrinsics.");
  window_.origin_x = static_cast<int>(low.x());
  window_.origin_y = static_cast<int>(low.y());
  window_.origin_z = static_cast<int>(low.z());
  window_.size_x = static_cast<int>(size.x());
  window_.size_y = static_cast<int>(size.y());
  window_.size_z = static_cast<int>(size.z());
  window_.block_size = static_cast<float>(block_size);
  T_camera_local_ = T_world_camera.inverse() * Eigen::Translation3d(low * block_size);
}

BlockKey MapWindow::block(int cell) const {
  const int x = cell % window_.size_x, y = cell / window_.size_x % window_.size_y, z = cell / window_.size_x / window_.size_y;
  return {window_.origin_x + x, window_.origin_y + y, window_.origin_z + z};
}

Eigen::Vector3d MapWindow::corner(const BlockKey& block) const {
  return Eigen::Vector3d(block.x - window_.origin_x, block.y - window_.origin_y, block.z - window_.origin_z) * window_.block_size;
}

bool MapWindow::meets_grid(const BlockKey& block) const {
  Eigen::Array<double, 8, 3> p;  // the block's corners, camera frame
  for (int n = 0; n < 8; ++n)
    p.row(n) = (T_camera_local_ * (corner(block) + window_.block_size * Eigen::Vector3d(n & 1, n >> 1 & 1, n >> 2))).array();
  const auto x = p.col(0), y = p.col(1), z = p.col(2);
  const double voxel_low = std::max<double>(z.minCoeff(), grid_.z_min) / grid_.f;
  constexpr double kRounded = 1.001,
                   kMore = REACH_MARGIN + 0.1;  // radii are kept with 11 bits; [voxel], a tenth for rounding in the kernel
  const double reach = std::max(2 * kRounded * extent_.largest_radius / voxel_low, extent_.thickness) + kMore;  // [voxel]
  if (z.maxCoeff() < -(grid_.padding_k + reach) * grid_.delta_min) return false;
  // Surfels reach the further, the deeper they are, but not as fast as depth grows.
  if (2 * (extent_.thickness + kMore) < grid_.f && z.minCoeff() > std::max<double>(grid_.z_max, z_far_) + 2 * reach * voxel_low)
    return false;
  return !is_beside({grid_.fx, grid_.center_i, double(grid_.size_i)}, x, z, grid_.z_min, reach) &&
         !is_beside({grid_.fy, grid_.center_j, double(grid_.size_j)}, y, z, grid_.z_min, reach);
}

std::vector<BlockKey> MapWindow::blocks_near(double distance, std::size_t most) const {
  const int more = static_cast<int>(std::floor(distance / window_.block_size)) + 1;  // those that only touch it, too, as is_near()
  const std::size_t size_x = window_.size_x + 2 * more, size_y = window_.size_y + 2 * more, size_z = window_.size_z + 2 * more;
  std::vector<BlockKey> blocks;
  if (size_x * size_y * size_z > most) return blocks;
  for (int z = -more; z < window_.size_z + more; ++z)
    for (int y = -more; y < window_.size_y + more; ++y)
      for (int x = -more; x < window_.size_x + more; ++x)
        blocks.push_back({window_.origin_x + x, window_.origin_y + y, window_.origin_z + z});
  return blocks;
}

bool MapWindow::is_near(const BlockKey& block, double distance) const {
  const Eigen::Vector3d low = corner(block), high = low + Eigen::Vector3d::Constant(window_.block_size);
  const Eigen::Vector3d size = Eigen::Vector3d(window_.size_x, window_.size_y, window_.size_z) * window_.block_size;
  return (high.array() >= -distance).all() && (low.array() <= size.array() + distance).all();
}

}  // namespace frontier_surfels
