#include "synthetic/synthetic_scenes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace frontier_surfels::replay {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using scoring::OrientedBox;
using scoring::SceneObject;
using scoring::Stand;

constexpr double kWalkBegins = 0.15, kWalkEnds = 0.8;  // shares of the recording

/// A box with edges along the axes of its object.
OrientedBox part(const Vector3d& low, const Vector3d& high) {
  return {Eigen::Isometry3d(Eigen::Translation3d((low + high) / 2)), (high - low) / 2};
}

Eigen::Isometry3d standing(const Vector3d& p_world, double yaw) {
  return Eigen::Translation3d(p_world) * Eigen::AngleAxisd(yaw, Vector3d::UnitZ());
}

/// A cardboard box on the table's free corner, in the frames from `first` to before `end` of each period.
SceneThing box_on_table(const std::vector<std::pair<int, int>>& periods) {
  SceneThing thing{{"box", {part({-0.18, -0.13, 0}, {0.18, 0.13, 0.3})}, {}}, {{190, 150, 100}}};
  for (const auto& [first, end] : periods) {
    if (first >= end) continue;
    thing.object.stands.push_back(
        {static_cast<std::size_t>(first), static_cast<std::size_t>(end - 1), standing({0.45, -0.28, 0.74}, M_PI / 12)});
  }
  return thing;
}

/// The point after `length` metres of a way, and the direction there.
std::pair<Vector2d, Vector2d> along(const std::vector<Vector2d>& way, double length) {
  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
    const Vector2d step = way[i + 1] - way[i];
    if (length <= step.norm() || i + 2 == way.size()) return {way[i] + step.normalized() * length, step.normalized()};
    length -= step.norm();
  }
  return {way.front(), Vector2d::UnitX()};
}

double length_of(const std::vector<Vector2d>& way) {
  double length = 0;
  for (std::size_t i = 0; i + 1 < way.size(); ++i) length += (way[i + 1] - way[i]).norm();
  return length;
}

/// Begins and ends in the corridor, where the room's wall hides it.
SceneThing person(int frames) {
  SceneThing thing{{"person",
                    {part({-0.08, 0.03, 0}, {0.08, 0.19, 0.85}), part({-0.08, -0.19, 0}, {0.08, -0.03, 0.85}),
                     part({-0.12, -0.23, 0.85}, {0.12, 0.23, 1.45}), part({-0.1, -0.08, 1.45}, {0.1, 0.08, 1.72})},
                    {}},
                   {{50, 60, 110}, {50, 60, 110}, {170, 60, 60}, {220, 180, 150}}};
  const std::vector<Vector2d> in = {{0.2, 3.05}, {0.95, 2.9}, {1.05, 2.1}, {1.35, 1.1}, {1.35, -0.3}};
  std::vector<Vector2d> way = in;
  way.insert(way.end(), in.rbegin() + 1, in.rend());
  const int first = static_cast<int>(kWalkBegins * frames), end = static_cast<int>(kWalkEnds * frames);
  for (int index = first; index < end; ++index) {
    const auto [position, direction] = along(way, length_of(way) * (index - first) / (end - first));
    const auto frame = static_cast<std::size_t>(index);
    thing.object.stands.push_back({frame, frame, standing({position.x(), position.y(), 0}, std::atan2(direction.y(), direction.x()))});
  }
  return thing;
}

}  // namespace

std::vector<SceneThing> scene_things(Scene scene, int frames) {
  switch (scene) {
    case Scene::kBoxAppears:
      return {box_on_table({{frames / 2, frames}})};
    case Scene::kBoxVanishes:
      return {box_on_table({{0, frames / 2}})};
    case Scene::kBoxReturns:
      return {box_on_table({{0, frames / 3}, {2 * frames / 3, frames}})};
    case Scene::kPersonWalks:
      return {person(frames)};
    default:
      return {};
  }
}

}  // namespace frontier_surfels::replay
