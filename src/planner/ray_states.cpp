#include "planner/ray_states.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "config/config_text.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kPointsAtOnce = 64;  // of a ray: most rays end early
constexpr double kMostPoints = 1e6;        // of a ray

/// A ray on its way.
struct Walk {
  std::size_t number;  ///< of the ray
  std::size_t next = 0, points;
};

Eigen::Vector3f point_on(const Ray& ray, std::size_t n, std::size_t points) {
  return n + 1 == points ? ray.to
                         : Eigen::Vector3f(ray.from + (ray.to - ray.from) * (static_cast<float>(n) / static_cast<float>(points - 1)));
}

std::size_t points_of(const Ray& ray, double step, std::size_t number) {
  const double length = (ray.to - ray.from).cast<double>().norm();
  if (!std::isfinite(length)) throw Error("Ray " + std::to_string(number) + " has an end that is not finite.");
  if (length > kMostPoints * step)
    throw Error("Ray " + std::to_string(number) + " is " + to_text(length) + " m long, too much for steps of " + to_text(step) + " m.");
  return static_cast<std::size_t>(std::ceil(length / step)) + 1;
}

}  // namespace

std::vector<RayState> ray_states(const std::vector<Ray>& rays_world, bool stop_at_unknown, double step, const StatesOf& states_of) {
  if (!(step >= 1e-4 && step <= 10)) throw Error("The step along rays is " + to_text(step) + " m: it must be from 0.0001 to 10 m.");
  std::vector<RayState> states;
  std::vector<Walk> walks;
  for (const Ray& ray : rays_world) {
    walks.push_back({states.size(), 0, points_of(ray, step, states.size())});
    states.push_back({SpaceState::kFree, (ray.to - ray.from).norm()});
  }
  while (!walks.empty()) {
    std::vector<Eigen::Vector3f> points;
    for (const Walk& walk : walks)
      for (std::size_t n = walk.next; n < std::min(walk.next + kPointsAtOnce, walk.points); ++n)
        points.push_back(point_on(rays_world[walk.number], n, walk.points));
    const std::vector<SpaceState> found = states_of(points);
    auto state = found.begin();
    for (Walk& walk : walks) {
      const std::size_t end = std::min(walk.next + kPointsAtOnce, walk.points);
      const auto last = state + static_cast<std::ptrdiff_t>(end - walk.next);
      const auto stop = std::find_if(state, last, [&](SpaceState s) { return ends_ray(s, stop_at_unknown); });
      walk.next = end;
      if (stop != last) {
        const Ray& ray = rays_world[walk.number];
        const std::size_t at = end - static_cast<std::size_t>(last - stop);
        states[walk.number] = {*stop, (point_on(ray, at, walk.points) - ray.from).norm()};
        walk.next = walk.points;
      }
      state = last;
    }
    walks.erase(std::remove_if(walks.begin(), walks.end(), [](const Walk& walk) { return walk.next == walk.points; }), walks.end());
  }
  return states;
}

}  // namespace frontier_surfels
