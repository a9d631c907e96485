/// The non-uniform voxel grid in double precision - section 3.1 of the paper, eq. (2)-(3).
#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"
#include "reference_field.hpp"

namespace frontier_surfels::reference {

using Eigen::Vector3d;
using Eigen::Vector3i;

struct Nuvg {
  Intrinsics camera;
  double z_min, f, delta_min, k_min;
  int padding_i, padding_j, padding_k;
  double center_i, center_j;
  int size_i, size_j, size_k;

  Nuvg(const Intrinsics& intrinsics, const Config& config)
      : camera(intrinsics),
        z_min(config.z_min),
        f((intrinsics.fx + intrinsics.fy) / 2),
        delta_min(z_min / f),
        k_min(config.padding_k + z_min / delta_min),
        padding_i(config.padding_i),
        padding_j(config.padding_j),
        padding_k(config.padding_k),
        center_i(intrinsics.cx + padding_i),
        center_j(intrinsics.cy + padding_j),
        size_i(intrinsics.width + 2 * padding_i),
        size_j(intrinsics.height + 2 * padding_j),
        size_k(0) {
    size_k = static_cast<int>(std::ceil(to_grid({0, 0, config.z_max}).z())) + 1;  // one layer for surfels behind z_max
  }

  double voxel_size(double z) const { return std::max(z, z_min) / f; }

  /// F: camera frame [m] -> grid coordinates. The cuboid, too, scales x by fx and y by fy, so that F is continuous if they differ.
  Vector3d to_grid(const Vector3d& p) const {
    if (p.z() < z_min) return {p.x() * camera.fx / z_min + center_i, p.y() * camera.fy / z_min + center_j, p.z() / delta_min + padding_k};
    return {p.x() * camera.fx / p.z() + center_i, p.y() * camera.fy / p.z() + center_j, f * std::log(p.z() / z_min) + k_min};
  }

  /// F^-1
  Vector3d from_grid(const Vector3d& c) const {
    if (c.z() < k_min)
      return {(c.x() - center_i) * z_min / camera.fx, (c.y() - center_j) * z_min / camera.fy, (c.z() - padding_k) * delta_min};
    const double z = z_min * std::exp((c.z() - k_min) / f);
    return {(c.x() - center_i) * z / camera.fx, (c.y() - center_j) * z / camera.fy, z};
  }

  Vector3d center_of(int i, int j, int k) const { return from_grid(Vector3d(i, j, k)); }

  bool contains(const Vector3i& v) const { return (v.array() >= 0).all() && v.x() < size_i && v.y() < size_j && v.z() < size_k; }

  template <typename T>
  Field<T> field(T value) const {
    return {size_i, size_j, size_k, value};
  }
};

/// The voxel that contains a grid coordinate; open if the coordinate is within `tolerance` of the border between two voxels.
struct Voxel {
  Vector3i index;
  bool open;
};

inline Voxel voxel_of(const Vector3d& c, double tolerance) {
  Voxel voxel = {Vector3i::Zero(), false};
  for (int axis = 0; axis < 3; ++axis) {
    const double shifted = c[axis] + 0.5, whole = std::floor(shifted);
    voxel.index[axis] = static_cast<int>(whole);
    if (shifted - whole < tolerance || whole + 1 - shifted < tolerance) voxel.open = true;
  }
  return voxel;
}

}  // namespace frontier_surfels::reference
