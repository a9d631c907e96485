// What planners ask: the states of points, rays, boxes and paths, and the boundary near points. Questions change nothing.
#include "mapper/mapper_impl.hpp"
#include "planner/box_states.hpp"
#include "planner/ray_states.hpp"

namespace frontier_surfels {

std::vector<SpaceState> Mapper::states(const std::vector<Eigen::Vector3f>& points_world) const {
  return on_device([&] { return impl_->states(points_world); });
}

std::vector<SpaceState> Mapper::Impl::states(const std::vector<Eigen::Vector3f>& points_world) {
  begin_call();
  remember_forgotten();
  return point_states.find(points_world, {views, seen, taking_back, map, config.seen_points});
}

std::vector<RayState> Mapper::ray_states(const std::vector<Ray>& rays_world, bool stop_at_unknown, double step) const {
  return frontier_surfels::ray_states(rays_world, stop_at_unknown, step, [this](const auto& points_world) { return states(points_world); });
}

std::vector<NearestBoundary> Mapper::nearest_boundaries(const std::vector<Eigen::Vector3f>& points_world, double reach) const {
  return on_device([&] {
    impl_->begin_call();
    return impl_->boundaries.nearest(points_world, reach, impl_->map);
  });
}

std::vector<float> Mapper::clearance(const std::vector<Eigen::Vector3f>& points_world, double most) const {
  const std::vector<NearestBoundary> nearest = nearest_boundaries(points_world, most);
  const std::vector<SpaceState> of_points = states(points_world);
  std::vector<float> clearance(points_world.size(), 0.0F);
  for (std::size_t n = 0; n < points_world.size(); ++n)
    if (of_points[n] == SpaceState::kFree) clearance[n] = std::min(nearest[n].distance, static_cast<float>(most));
  return clearance;
}

std::vector<SpaceState> Mapper::box_states(const std::vector<Eigen::AlignedBox3f>& boxes_world, double step) const {
  return frontier_surfels::box_states(
      boxes_world, step, [this](const auto& points_world) { return states(points_world); },
      [this](const auto& boxes, bool frontier_counts) { return on_device([&] { return impl_->first_within(boxes, frontier_counts); }); });
}

std::vector<RayState> Mapper::path_states(const std::vector<Ray>& paths_world, const Eigen::Vector3f& box_size, bool stop_at_unknown,
                                          double step) const {
  return frontier_surfels::path_states(
      paths_world, box_size, stop_at_unknown, step, [this](const auto& points_world) { return states(points_world); },
      [this](const auto& boxes, bool frontier_counts) { return on_device([&] { return impl_->first_within(boxes, frontier_counts); }); });
}

std::vector<FirstSurfel> Mapper::Impl::first_within(const std::vector<MovingBox>& boxes, bool frontier_counts) {
  begin_call();
  return boundaries.first_within(boxes, frontier_counts, map);
}

}  // namespace frontier_surfels
