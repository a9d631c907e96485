/// States along straight ways, by the states of points on them.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "frontier_surfels/planner/states.hpp"

namespace frontier_surfels {

using StatesOf = std::function<std::vector<SpaceState>(const std::vector<Eigen::Vector3f>&)>;

/// See Mapper::ray_states(). @param states_of  answers for points
std::vector<RayState> ray_states(const std::vector<Ray>& rays_world, bool stop_at_unknown, double step, const StatesOf& states_of);

}  // namespace frontier_surfels
