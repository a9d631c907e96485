/// Points spread evenly over the surfaces of a scene.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "synthetic/world.hpp"

namespace frontier_surfels::replay {

struct SurfacePoint {
  Eigen::Vector3d position;  ///< world frame [m]
  Eigen::Vector3d normal;    ///< unit length, out of the solid
};

/// The surfaces of all solids in cells of about `spacing` x `spacing`, each by its middle; every face has one point at least. Left out is
/// what another solid covers: points with no free space a millimetre in front of them.
std::vector<SurfacePoint> surface_points(const World& world, double spacing);

}  // namespace frontier_surfels::replay
