/// Observed space C~, literally: for every pixel and every layer - paper 3.3, eq. (9)-(11).
#pragma once

#include "reference_grid.hpp"
#include "working_image.hpp"

namespace frontier_surfels::reference {

/// @param layer_depth  z of each layer's centre [m], as the device has it: a depth equal to one must be decided exactly
inline Field<Truth> observed_space(const Nuvg& grid, const WorkingImage& image, const std::vector<float>& layer_depth) {
  const Intrinsics& camera = grid.camera;
  Field<Truth> observed = grid.field(Truth::no);
  for (int t = 0; t < camera.height; ++t) {
    for (int s = 0; s < camera.width; ++s) {
      const float depth = image.depth[t * camera.width + s];
      if (depth == 0) continue;
      const double d = std::abs(depth);  // negative: nothing was met up to there
      for (int k = 0; k < grid.size_k; ++k)
        if (k >= grid.k_min && layer_depth[k] < d) observed(s + grid.padding_i, t + grid.padding_j, k) = Truth::yes;
      for (int k = grid.padding_k; k < grid.k_min && k < grid.size_k; ++k) {
        const double z = (k - grid.padding_k) * grid.delta_min;
        const Vector3d sample(z / camera.fx * (s - camera.cx), z / camera.fy * (t - camera.cy), z);
        // k is whole by construction; along i and j doubles decide, as they do in the table of footprints.
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

}  // namespace frontier_surfels::reference
