/// What a map says of points and rays of the world: Mapper::states(), Mapper::ray_states().
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace frontier_surfels {

enum class SpaceState : std::uint8_t {
  kUnknown = 0,   ///< no image has shown what is there, or what stands there now hides it
  kFree = 1,      ///< seen to be empty
  kOccupied = 2,  ///< at most a voxel from the centre of an occupied surfel, on whichever side of the surface
};

/// A straight way between two points of the world [m].
struct Ray {
  Eigen::Vector3f from = Eigen::Vector3f::Zero(), to = Eigen::Vector3f::Zero();
};

/// Where a ray ends, and why.
struct RayState {
  SpaceState state = SpaceState::kUnknown;  ///< what stopped the ray; kFree: nothing, it has reached its end
  float distance = 0;                       ///< from its start to there [m]
};

}  // namespace frontier_surfels
