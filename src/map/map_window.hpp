/// The part of the map around a view's grid - what a frame works on, however large the map is.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "common/shared.h"
#include "map/block_key.hpp"

namespace frontier_surfels {

/// How large the map's surfels are.
struct SurfelExtent {
  double largest_radius = 0;  ///< [m]
  double thickness = 0;       ///< of their ellipsoids [voxel]
};

class MapWindow {
 public:
  MapWindow() = default;

  /// @param margin  how far surfels beyond the grid may reach into it [m]
  /// @throws BadFrame  the grid is absurdly large for its range
  MapWindow(const Grid& grid, const Eigen::Isometry3d& T_world_camera, double block_size, double margin, const SurfelExtent& extent);

  const Window& window() const { return window_; }
  const Eigen::Isometry3d& T_camera_local() const { return T_camera_local_; }
  int cells() const { return window_.size_x * window_.size_y * window_.size_z; }
  BlockKey block(int cell) const;

  /// Could a surfel of this block be in view? As generous as kernels/stages/3_visit.cl is with each of them.
  bool meets_grid(const BlockKey& block) const;

  /// All blocks, be there surfels or not, within `distance` [m] of the window; none if they are more than `most`.
  std::vector<BlockKey> blocks_near(double distance, std::size_t most) const;

  /// Is the block within `distance` [m] of the window?
  bool is_near(const BlockKey& block, double distance) const;

 private:
  Eigen::Vector3d corner(const BlockKey& block) const;  ///< local frame [m]

  Grid grid_ = {};
  Window window_ = {};
  Eigen::Isometry3d T_camera_local_ = Eigen::Isometry3d::Identity();  ///< of an empty window only
  SurfelExtent extent_;
  double z_far_ = 0;  ///< depth at which the grid ends [m]
};

/// Largest distance between the camera and a point of its grid [m].
double grid_reach(const Grid& grid);

/// Edge of the blocks for a range [m]: a power of two, half a metre where the range is short.
double block_size_for(double z_max);

}  // namespace frontier_surfels
