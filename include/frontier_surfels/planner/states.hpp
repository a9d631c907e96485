/// What a map says of points, rays, boxes and paths of the world: Mapper::states() and the questions after it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>

#include "frontier_surfels/types.hpp"

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

/// Does a ray end at something like this?
inline bool ends_ray(SpaceState state, bool stop_at_unknown) {
  return state == SpaceState::kOccupied || (stop_at_unknown && state == SpaceState::kUnknown);
}

/// Where a ray, or a path, ends, and why.
struct RayState {
  SpaceState state = SpaceState::kUnknown;  ///< what stopped the ray; kFree: nothing, it has reached its end
  float distance = 0;                       ///< from its start to there [m]
};

/// The boundary of known space near a point: the surfel whose centre is nearest. Which side of it the point is on is not its state: near
/// the rims of sheets and at edges, a free point may be behind a surfel that looks past it.
struct NearestBoundary {
  static constexpr std::uint32_t kNone = 0xffffffff;

  float distance = std::numeric_limits<float>::infinity();  ///< from the surfel's centre [m]; infinite: none is within reach
  bool in_front = false;                                    ///< is the point on the known side, to which the surfel's normal points?
  Label label = Label::kFrontier;                           ///< of the surfel
  std::uint32_t id = kNone;                                 ///< of the surfel; kNone: none is within reach
};

}  // namespace frontier_surfels
