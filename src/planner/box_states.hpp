/// States of boxes that stand or move, by the states of points in them and by the surfels within.
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "frontier_surfels/planner/states.hpp"
#include "planner/boundaries.hpp"
#include "planner/ray_states.hpp"

namespace frontier_surfels {

/// Answers Boundaries::first_within().
using FirstWithin = std::function<std::vector<FirstSurfel>(const std::vector<MovingBox>& boxes, bool frontier_counts)>;

/// See Mapper::box_states().
std::vector<SpaceState> box_states(const std::vector<Eigen::AlignedBox3f>& boxes_world, double step, const StatesOf& states_of,
                                   const FirstWithin& first_within);

/// See Mapper::path_states().
std::vector<RayState> path_states(const std::vector<Ray>& paths_world, const Eigen::Vector3f& box_size, bool stop_at_unknown, double step,
                                  const StatesOf& states_of, const FirstWithin& first_within);

}  // namespace frontier_surfels
