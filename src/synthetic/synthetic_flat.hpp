/// A furnished flat of five rooms and a corridor, for exploring in closed loop.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "synthetic/world.hpp"

namespace frontier_surfels::replay {

/// The flat, 10 x 8 x 2.5 m from the origin, z up; nothing moves in it. A ray from inside always meets a surface. The corridor runs along
/// x, between y = 3.3 and 4.6; south of it lie the living room and the kitchen, north of it the bedroom, the bathroom and the study. All
/// doors are open, at least 0.9 m wide and 2.05 m high; a second one joins living room and kitchen.
World synthetic_flat();

/// The space within the outer walls, floor and ceiling.
Eigen::AlignedBox3d flat_bounds();

/// Places for a camera to start, 1.2 m high: in the corridor, looking along it, and in living room, kitchen, bedroom and study. Body frame
/// (x forward, y left, z up).
std::vector<Eigen::Isometry3d> flat_starts();

/// The first of them.
Eigen::Isometry3d flat_start();

}  // namespace frontier_surfels::replay
