/// A surfel of the map as the view's grid sees it, and random surfels around a view.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "map/map_window.hpp"
#include "map/surfel_packing.hpp"
#include "random_input.hpp"
#include "reference_grid.hpp"

namespace frontier_surfels::reference {

/// Are all fields equal?
inline bool same(const Surfel& a, const Surfel& b) {
  return a.id == b.id && a.position == b.position && a.normal == b.normal && a.radius == b.radius && a.label == b.label && a.rgb == b.rgb;
}

/// Step of the map's positions [m]: along each axis a stored surfel is at most this far from its given position.
inline double position_step(const Config& config) { return block_size_for(config.z_max) / 65536; }

/// The surfel after packing into the map and unpacking.
inline Surfel quantised(const Surfel& surfel, const Config& config) {
  const double block_size = block_size_for(config.z_max);
  const BlockKey block = block_of(surfel.position, block_size);
  return unpack(pack(surfel, block, block_size), block, block_size);
}

/// Slots of every `stride`-th surfel.
inline std::vector<std::uint32_t> some_slots(const std::vector<Surfel>& surfels, std::size_t stride) {
  std::vector<std::uint32_t> slots;
  for (std::size_t n = 0; n < surfels.size(); n += stride) slots.push_back(surfels[n].id);
  return slots;
}

struct SeenSurfel {
  Vector3d p_camera;    ///< [m]
  Vector3d c;           ///< F(p)
  double rho;           ///< twice the radius [voxel]
  Vector3d normal;      ///< camera frame
  double n_k;           ///< cosine with the paths along k
  bool ragged = false;  ///< opens no path to known space
  Vector3d ray;         ///< motion of a step along k, in locally metric voxel coordinates
};

inline SeenSurfel see(const Nuvg& grid, const Eigen::Isometry3d& T_camera_world, const Surfel& surfel) {
  SeenSurfel seen;
  seen.p_camera = T_camera_world * surfel.position.cast<double>();
  seen.normal = T_camera_world.linear() * surfel.normal.cast<double>();
  seen.c = grid.to_grid(seen.p_camera);
  seen.rho = 2 * surfel.radius / grid.voxel_size(seen.p_camera.z());
  const bool pyramid = seen.p_camera.z() >= grid.z_min;
  seen.ray = pyramid ? Vector3d(seen.p_camera / seen.p_camera.z()) : Vector3d(0, 0, 1);
  seen.n_k = seen.normal.dot(seen.ray.normalized());
  return seen;
}

/// Surfels in the grid and up to `around` voxels beyond it.
/// @param largest  largest radius [voxel]
inline std::vector<Surfel> random_surfels(const Nuvg& grid, const Eigen::Isometry3d& T_world_camera, int count, double around,
                                          double largest, Random& random) {
  std::vector<Surfel> surfels;
  for (int n = 0; n < count; ++n) {
    const Vector3d c(random.uniform(-around, grid.size_i + around), random.uniform(-around, grid.size_j + around),
                     random.uniform(-around, grid.size_k + around));
    const Vector3d p_camera = grid.from_grid(c);
    Surfel surfel;
    surfel.position = (T_world_camera * p_camera).cast<float>();
    surfel.normal = random.direction().cast<float>();
    surfel.radius = static_cast<float>(random.uniform(0.3, largest) * grid.voxel_size(p_camera.z()));
    if (random.chance(0.3)) surfel.label = Label::kOccupied;
    if (random.chance(0.2)) surfel.rgb = {static_cast<std::uint8_t>(random.whole(1, 255)), 17, 255};
    surfels.push_back(surfel);
  }
  return surfels;
}

}  // namespace frontier_surfels::reference
