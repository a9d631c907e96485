#include "map_window.hpp"

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

/// Is a ball outside the plane through the camera with this slope? @param side  1: the grid lies above the slope, -1: below
bool beyond(double x, double z, double slope, double side, double radius) {
  return side * (x - slope * z) < -radius * std::sqrt(1 + slope * slope);
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

MapWindow::MapWindow(const Grid& grid, const Eigen::Isometry3d& T_world_camera, double block_size, double margin) : grid_(grid) {
  z_far_ = far_end(grid);
  sphere_ = block_size * std::sqrt(3.0) / 2 + margin;

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
  const Eigen::Vector3d p = T_camera_local_ * (corner(block) + Eigen::Vector3d::Constant(window_.block_size / 2));
  if (p.z() < -(grid_.padding_k + 0.5) * grid_.delta_min - sphere_ || p.z() > z_far_ + sphere_) return false;
  const Eigen::Vector4d slopes = border_slopes(grid_);
  const bool in_pyramid = !beyond(p.x(), p.z(), slopes[0], 1, sphere_) && !beyond(p.x(), p.z(), slopes[1], -1, sphere_) &&
                          !beyond(p.y(), p.z(), slopes[2], 1, sphere_) && !beyond(p.y(), p.z(), slopes[3], -1, sphere_);
  if (in_pyramid || p.z() > grid_.z_min + sphere_) return in_pyramid;
  const Eigen::Vector4d sides = slopes * grid_.z_min;  // of the cuboid before the pyramid
  return p.x() > sides[0] - sphere_ && p.x() < sides[1] + sphere_ && p.y() > sides[2] - sphere_ && p.y() < sides[3] + sphere_;
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
