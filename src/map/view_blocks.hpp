/// The blocks of the map that a view may have seen something of.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "common/shared.h"
#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"

namespace frontier_surfels {

struct ViewBlocks {
  Window window = {};                ///< that has them all
  Eigen::Isometry3d T_camera_local;  ///< local: the window's frame
  std::vector<BlockKey> blocks;
};

/// @param deepest  largest depth of the view's image [m]
ViewBlocks blocks_of_view(const Intrinsics& intrinsics, const Eigen::Isometry3d& T_world_camera, double deepest, double block_size);

}  // namespace frontier_surfels
