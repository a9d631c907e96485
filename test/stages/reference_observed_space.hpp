/// Observed space C~, computed literally for every pixel and layer - paper 3.3, eq. (9)-(11) -, and questions about a voxel and its
/// neighbours.
#pragma once

#include <vector>

#include "frame/working_image.hpp"
#include "reference_grid.hpp"

namespace frontier_surfels::reference {

/// @param layer_depth  z of each layer's centre [m] on the device: a depth equal to one of them must be decided exactly
inline Field<Truth> observed_space(const Nuvg& grid, const WorkingImage& image, const std::vector<float>& layer_depth) {
  const Intrinsics& camera = grid.camera;
  Field<Truth> observed = grid.field(Truth::no);
  for (int t = 0; t < camera.height; ++t) {
    for (int s = 0; s < camera.width; ++s) {
      const float depth = image.depth[t * camera.width + s];
      if (depth == 0) continue;
      const double d = std::abs(depth);  // negative: free space up to there
      for (int k = 0; k < grid.size_k; ++k)
        if (k >= grid.k_min && layer_depth[k] < d) observed(s + grid.padding_i, t + grid.padding_j, k) = Truth::yes;
      for (int k = grid.padding_k; k < grid.k_min && k < grid.size_k; ++k) {
        const double z = (k - grid.padding_k) * grid.delta_min;
        const Vector3d sample(z / camera.fx * (s - camera.cx), z / camera.fy * (t - camera.cy), z);
        // k is whole by construction. Along i and j doubles decide, as in the grid's tables of pixels.
        Vector3d c = grid.to_grid(sample);
        c.z() = k;
        const Voxel voxel = voxel_of(c, 1e-9);
        if (voxel.open || !grid.contains(voxel.index)) {
          for (int di = -1; di <= 1 && voxel.open; ++di)
            for (int dj = -1; dj <= 1; ++dj) {
              const Vector3i beside = voxel.index + Vector3i(di, dj, 0);
              if (!grid.contains(beside)) continue;
              Truth& value = observed(beside.x(), beside.y(), k);
              value = value || Truth::open;
            }
          continue;
        }
        observed(voxel.index.x(), voxel.index.y(), k) = Truth::yes;
      }
    }
  }
  return observed;
}

/// Does the column of observed voxels end at a measured surface in voxel v, or does a point of v at depth z lie up to surface_depth behind
/// that surface?
inline Truth at_surface(const Nuvg& grid, const WorkingImage& image, const std::vector<float>& layer_depth, double surface_depth,
                        const Vector3i& v, double z) {
  const int s = v.x() - grid.padding_i, t = v.y() - grid.padding_j, k = v.z();
  if (s < 0 || t < 0 || s >= grid.camera.width || t >= grid.camera.height || k <= grid.k_min) return Truth::no;
  const double d = image.depth[t * grid.camera.width + s];
  if (d <= 0) return Truth::no;  // no measurement, or free space
  const auto observed = [&](int layer) { return layer >= grid.k_min && layer < grid.size_k && layer_depth[layer] < d; };
  return truth(observed(k - 1) && !observed(k)) || (!less(z, d, 1e-5) && !less(d + surface_depth, z, 1e-5));
}

/// Unit vectors from voxel v to its observed neighbours (C~ = 1) among the 26.
inline std::vector<Vector3d> directions(const Nuvg& grid, const Field<char>& observed, const Vector3i& v) {
  std::vector<Vector3d> found;
  for (int n = 0; n < 27; ++n) {
    const Vector3i u = v + Vector3i(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
    if (u == v || !grid.contains(u) || !observed(u.x(), u.y(), u.z())) continue;
    found.push_back((grid.center_of(u.x(), u.y(), u.z()) - grid.center_of(v.x(), v.y(), v.z())).normalized());
  }
  return found;
}

inline Vector3d sum_of_directions(const Nuvg& grid, const Field<char>& observed, const Vector3i& v) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& direction : directions(grid, observed, v)) sum += direction;
  return sum;
}

}  // namespace frontier_surfels::reference
