/// The blocks of the map around a view's grid. A frame works on these alone, so its cost does not grow with the map.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "common/shared.h"
#include "map/block_key.hpp"

namespace frontier_surfels {

/// Upper bounds of the sizes of the map's surfels.
struct SurfelExtent {
  double largest_radius = 0;  ///< [m]
  double thickness = 0;       ///< reach along the normal [voxel]
};

class MapWindow {
 public:
  MapWindow() = default;

  /// @param margin  largest distance from the grid at which a surfel may still reach into it [m]
  /// @throws BadFrame  the grid is far too large for its range
  MapWindow(const Grid& grid, const Eigen::Isometry3d& T_world_camera, double block_size, double margin, const SurfelExtent& extent);

  /// The blocks from `first`, the lowest one, to `last`, the highest one.
  MapWindow(const BlockKey& first, const BlockKey& last, double block_size);

  const Window& window() const { return window_; }
  const Eigen::Isometry3d& T_camera_local() const { return T_camera_local_; }
  int cells() const { return window_.size_x * window_.size_y * window_.size_z; }
  Eigen::Vector3d corner_world() const;  ///< its lowest corner [m]
  BlockKey block(int cell) const;        ///< the block that a cell of the window stands for

  /// May a surfel of this block be in view? True for every block with a surfel that kernels/stages/5_visit.cl finds in view.
  bool meets_grid(const BlockKey& block) const;

  /// All blocks within `distance` [m] of the window, with or without surfels; none if there are more than `max_count`.
  std::vector<BlockKey> blocks_near(double distance, std::size_t max_count) const;

  /// Is the block within `distance` [m] of the window?
  bool is_near(const BlockKey& block, double distance) const;

 private:
  Eigen::Vector3d corner(const BlockKey& block) const;  ///< lowest corner, local frame [m]

  Grid grid_ = {};
  Window window_ = {};
  Eigen::Isometry3d T_camera_local_ = Eigen::Isometry3d::Identity();  ///< identity only while the window is empty
  Eigen::Array<double, 8, 3> to_corners_ =
      Eigen::Array<double, 8, 3>::Zero();  ///< from a block's lowest corner to all of them, camera frame [m]
  SurfelExtent extent_;
  double z_far_ = 0;  ///< depth at which the grid ends [m]
};

/// Largest distance between the camera and a point of its grid [m].
double grid_reach(const Grid& grid);

/// Edge of the map's blocks for a range z_max [m]: half a metre, doubled until 24 blocks cover the range.
double block_size_for(double z_max);

}  // namespace frontier_surfels
