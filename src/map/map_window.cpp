#include "map/map_window.hpp"

#include <algorithm>
#include <cmath>

#include "frontier_surfels/number_text.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

constexpr double kMaxCells = 1 << 20;  // enough for a range of 24 blocks and a field of view of 150 degrees

/// Slopes x / z and y / z of the grid's borders in the camera frame: low and high along i, low and high along j.
Eigen::Vector4d border_slopes(const Grid& g) {
  return {(-0.5 - g.center_i) / g.fx, (g.size_i - 0.5 - g.center_i) / g.fx, (-0.5 - g.center_j) / g.fy,
          (g.size_j - 0.5 - g.center_j) / g.fy};
}

/// Depth at which the grid ends [m].
double far_end(const Grid& g) { return g.z_min * std::exp((g.size_k - g.k_min) / g.f); }

/// An axis of the grid's cross-section.
struct Axis {
  double f, center, size;  ///< focal length [pixel], optical axis [voxel], number of voxels
};

/// Do all surfels with centres in a box lie beside the grid along an axis, that is, all below its low end or all above its high end?
///
/// A surfel at (x, z) has the grid coordinate i = f x / m + center, where m = max(z, z_min). It lies beside the grid if
/// i <= -reach (1 + |x| / m) or i >= size + reach (1 + |x| / m). Multiplied by m, each condition says that a function of x
/// and z is at most 0. If the function is convex, this holds in the whole box when it holds at the corners.
/// @param x, z   coordinates of the box's corners, camera frame [m]
/// @param reach  largest reach of a surfel in the box [voxel]
bool is_beside(const Axis& axis, const Eigen::Array<double, 8, 1>& x, const Eigen::Array<double, 8, 1>& z, double z_min, double reach) {
  const Eigen::Array<double, 8, 1> m = z.max(z_min), at = axis.f * x + axis.center * m, beyond = reach * (m + x.abs());
  const bool bent = z.minCoeff() < z_min;  // m is not linear in the box: the function is convex only if m's factor is not negative
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
  // The grid lies within the convex hull of its two ends.
  const Eigen::Vector4d slopes = border_slopes(grid);
  Eigen::AlignedBox3d box;
  for (const auto& [z, scale] :
       {std::make_pair(-(grid.padding_k + 0.5) * grid.delta_min, double{grid.z_min}), std::make_pair(z_far_, z_far_)})
    for (const double i : {slopes[0], slopes[1]})
      for (const double j : {slopes[2], slopes[3]}) box.extend(T_world_camera * Eigen::Vector3d(i * scale, j * scale, z));
  const Eigen::Vector3d low = ((box.min().array() - margin) / block_size).floor(),
                        high = ((box.max().array() + margin) / block_size).floor();
  const Eigen::Vector3d size = high - low + Eigen::Vector3d::Ones();
  if (!(size.prod() < kMaxCells))
    throw BadFrame("The view's grid would be " + fixed_text(size.maxCoeff() * block_size, 1) + " m large, too much for a range of " +
                   fixed_text(grid.z_max, 1) + " m; check the intrinsics.");
  window_.origin_x = static_cast<int>(low.x());
  window_.origin_y = static_cast<int>(low.y());
  window_.origin_z = static_cast<int>(low.z());
  window_.size_x = static_cast<int>(size.x());
  window_.size_y = static_cast<int>(size.y());
  window_.size_z = static_cast<int>(size.z());
  window_.block_size = static_cast<float>(block_size);
  T_camera_local_ = T_world_camera.inverse() * Eigen::Translation3d(low * block_size);
  for (int n = 0; n < 8; ++n)
    to_corners_.row(n) = (T_camera_local_.linear() * (window_.block_size * Eigen::Vector3d(n & 1, n >> 1 & 1, n >> 2))).array();
}

MapWindow::MapWindow(const BlockKey& first, const BlockKey& last, double block_size)
    : window_{first.x, first.y, first.z, last.x - first.x + 1, last.y - first.y + 1, last.z - first.z + 1, static_cast<float>(block_size)} {
}

Eigen::Vector3d MapWindow::corner_world() const {
  return Eigen::Vector3d(window_.origin_x, window_.origin_y, window_.origin_z) * window_.block_size;
}

BlockKey MapWindow::block(int cell) const {
  const int x = cell % window_.size_x, y = cell / window_.size_x % window_.size_y, z = cell / window_.size_x / window_.size_y;
  return {window_.origin_x + x, window_.origin_y + y, window_.origin_z + z};
}

Eigen::Vector3d MapWindow::corner(const BlockKey& block) const {
  return Eigen::Vector3d(block.x - window_.origin_x, block.y - window_.origin_y, block.z - window_.origin_z) * window_.block_size;
}

bool MapWindow::meets_grid(const BlockKey& block) const {
  const Eigen::Vector3d lowest = T_camera_local_ * corner(block);
  const Eigen::Array<double, 8, 3> p = to_corners_.rowwise() + lowest.array().transpose();  // the block's corners, camera frame
  const auto x = p.col(0), y = p.col(1), z = p.col(2);
  const double voxel_low = std::max<double>(z.minCoeff(), grid_.z_min) / grid_.f;
  constexpr double kRadiusRounding = 1.001;       // stored radii have 11 bits
  constexpr double kMargin = REACH_MARGIN + 0.1;  // [voxel]; the kernel's margin, and 0.1 for the kernel's rounding
  const double reach = std::max(2 * kRadiusRounding * extent_.largest_radius / voxel_low, extent_.thickness) + kMargin;  // [voxel]
  if (z.maxCoeff() < -(grid_.padding_k + reach) * grid_.delta_min) return false;
  // The reach of surfels grows with their depth, but more slowly than the depth, so the nearest corner decides.
  if (2 * (extent_.thickness + kMargin) < grid_.f && z.minCoeff() > std::max<double>(grid_.z_max, z_far_) + 2 * reach * voxel_low)
    return false;
  return !is_beside({grid_.fx, grid_.center_i, double(grid_.size_i)}, x, z, grid_.z_min, reach) &&
         !is_beside({grid_.fy, grid_.center_j, double(grid_.size_j)}, y, z, grid_.z_min, reach);
}

std::vector<BlockKey> MapWindow::blocks_near(double distance, std::size_t max_count) const {
  const int around = static_cast<int>(std::floor(distance / window_.block_size)) + 1;  // [block]; as in is_near(), touching is near
  const std::size_t size_x = window_.size_x + 2 * around, size_y = window_.size_y + 2 * around, size_z = window_.size_z + 2 * around;
  std::vector<BlockKey> blocks;
  if (size_x * size_y * size_z > max_count) return blocks;
  for (int z = -around; z < window_.size_z + around; ++z)
    for (int y = -around; y < window_.size_y + around; ++y)
      for (int x = -around; x < window_.size_x + around; ++x)
        blocks.push_back({window_.origin_x + x, window_.origin_y + y, window_.origin_z + z});
  return blocks;
}

bool MapWindow::is_near(const BlockKey& block, double distance) const {
  const Eigen::Vector3d low = corner(block), high = low + Eigen::Vector3d::Constant(window_.block_size);
  const Eigen::Vector3d size = Eigen::Vector3d(window_.size_x, window_.size_y, window_.size_z) * window_.block_size;
  return (high.array() >= -distance).all() && (low.array() <= size.array() + distance).all();
}

}  // namespace frontier_surfels
