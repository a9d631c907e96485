/// What a camera would see of the map from poses that it has not been to: Mapper::evaluate_views().
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "frontier_surfels/planner/states.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Views of one camera that are to be evaluated.
struct ViewQuestion {
  std::vector<Eigen::Isometry3d> T_world_camera;  ///< poses of the optical frame (x right, y down, z forward); at most 100 000
  Intrinsics intrinsics;                          ///< of a camera without distortion; at most 4096 x 4096 pixels
  double min_range = 0;  ///< smallest depth along the optical axis that the camera measures [m]; what is nearer hides, but does not count
  double range = 4;      ///< largest such depth, from 0.05 to 100 [m]
  std::optional<Eigen::AlignedBox3f> box_world;  ///< only what is visible inside it counts, world frame [m]; what is outside hides
  double most_clearance = 1;                     ///< farther surfels are not looked for, from 0 to 5 [m]
};

/// What is visible in one of the views: hit by the ray through a pixel's centre within the range, and not hidden by a nearer surfel. The
/// backs of surfels hide, but do not count.
struct ViewValue {
  float frontier_area = 0;                  ///< of the part of the map that is visible [m2]
  float occupied_area = 0;                  ///< the same of occupied surfels [m2]
  std::uint32_t frontier_pixels = 0;        ///< pixels that see frontier
  std::uint32_t occupied_pixels = 0;        ///< pixels that see an occupied surfel
  std::uint32_t beyond_range_pixels = 0;    ///< pixels that see nothing at all within the range, be it a front or a back
  SpaceState state = SpaceState::kUnknown;  ///< of the camera's position: Mapper::states()
  float clearance = 0;  ///< from the camera to the centre of the nearest surfel, at most most_clearance; 0 if not free [m]
};

}  // namespace frontier_surfels
