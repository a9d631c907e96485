#include "map/view_blocks.hpp"

#include <cmath>

namespace frontier_surfels {
namespace {

/// Slopes x / z or y / z of the image's borders, half a pixel beyond the outer pixels.
Eigen::Vector2d slopes(double f, double c, int size) { return {(-0.5 - c) / f, (size - 0.5 - c) / f}; }

}  // namespace

ViewBlocks blocks_of_view(const Intrinsics& intrinsics, const Eigen::Isometry3d& T_world_camera, double deepest, double block_size) {
  const Eigen::Vector2d i = slopes(intrinsics.fx, intrinsics.cx, intrinsics.width),
                        j = slopes(intrinsics.fy, intrinsics.cy, intrinsics.height);
  Eigen::AlignedBox3d box(T_world_camera.translation());
  for (const double x : {i[0], i[1]})
    for (const double y : {j[0], j[1]}) box.extend(T_world_camera * (deepest * Eigen::Vector3d(x, y, 1)));
  const Eigen::Vector3d low = (box.min() / block_size).array().floor(), high = (box.max() / block_size).array().floor();
  ViewBlocks around;
  around.window = {static_cast<int>(low.x()),
                   static_cast<int>(low.y()),
                   static_cast<int>(low.z()),
                   static_cast<int>(high.x() - low.x()) + 1,
                   static_cast<int>(high.y() - low.y()) + 1,
                   static_cast<int>(high.z() - low.z()) + 1,
                   static_cast<float>(block_size)};
  around.T_camera_local = T_world_camera.inverse() * Eigen::Translation3d(low * block_size);

  // A block lies outside of the pyramid if all its corners lie beyond one of its sides.
  Eigen::Matrix<double, 6, 4> sides;  // n . p + d >= 0 inside
  sides << 1, 0, -i[0], 0, -1, 0, i[1], 0, 0, 1, -j[0], 0, 0, -1, j[1], 0, 0, 0, 1, 0, 0, 0, -1, deepest;
  const Eigen::Matrix<double, 6, 4> of_local = sides * around.T_camera_local.matrix();
  const Eigen::Matrix<double, 6, 1> reach = block_size / 2 * of_local.leftCols<3>().cwiseAbs().rowwise().sum();
  for (int z = 0; z < around.window.size_z; ++z)
    for (int y = 0; y < around.window.size_y; ++y)
      for (int x = 0; x < around.window.size_x; ++x) {
        const Eigen::Vector4d center((x + 0.5) * block_size, (y + 0.5) * block_size, (z + 0.5) * block_size, 1);
        if (((of_local * center + reach).array() >= -1e-9).all())
          around.blocks.push_back({around.window.origin_x + x, around.window.origin_y + y, around.window.origin_z + z});
      }
  return around;
}

}  // namespace frontier_surfels
