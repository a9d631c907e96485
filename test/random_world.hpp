/// Scenes of random solids, and slow, obvious versions of what a World says.
#pragma once

#include <algorithm>
#include <random>
#include <string>

#include "frontier_surfels/types.hpp"
#include "synthetic/world.hpp"

namespace frontier_surfels::replay {

using Random = std::mt19937;

/// @return the sentence with which it refuses
template <typename Call>
std::string refused(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

inline double number(Random& random, double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }

inline Eigen::Vector3d point_in(Random& random, const Eigen::AlignedBox3d& box) {
  const double x = number(random, box.min().x(), box.max().x()), y = number(random, box.min().y(), box.max().y());
  return {x, y, number(random, box.min().z(), box.max().z())};
}

/// A closed box from (-1, -1, -1) to (1, 1, 1), with this number of solids within it, some of them at the same place as others.
inline Solids random_solids(Random& random, int count) {
  Solids solids;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.1, 1.1}) {
      Eigen::Vector3d centre = Eigen::Vector3d::Zero(), half = Eigen::Vector3d::Constant(1.2);
      centre[axis] = side;
      half[axis] = 0.1;
      solids.push_back(box(centre - half, centre + half, {200, 200, 200}));
    }
  }
  for (int i = 0; i < count; ++i) {
    const auto shade = static_cast<std::uint8_t>(i);
    const Eigen::Vector3d low = point_in(random, {Eigen::Vector3d::Constant(-0.9), Eigen::Vector3d::Constant(0.6)});
    const double size = number(random, 0.05, 0.3);
    if (i % 4 == 3)
      solids.push_back(solids.back());
    else if (i % 3 == 0)
      solids.push_back(box(low, low + point_in(random, {Eigen::Vector3d::Constant(0.02), Eigen::Vector3d::Constant(0.3)}), {shade, 0, 0}));
    else if (i % 3 == 1)
      solids.push_back(cylinder(low, size / 2, size, {0, shade, 0}));
    else
      solids.push_back(sphere(low, size / 2, {0, 0, shade}));
    if (i % 4 == 3) solids.back().rgb = {255, 255, 255};
  }
  return solids;
}

inline double slow_distance(const Solids& solids, const Eigen::Vector3d& p) {
  double nearest = kNever;
  for (const Solid& solid : solids) nearest = std::min(nearest, distance_to(solid, p));
  return nearest;
}

/// Index of the first solid that the ray meets, and where; -1: none.
inline std::pair<int, double> slow_cast(const Solids& solids, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  std::pair<int, double> first = {-1, kNever};
  for (std::size_t i = 0; i < solids.size(); ++i) {
    const double t = cast_solid(solids[i], origin, direction, direction.cwiseInverse());
    if (t < first.second) first = {static_cast<int>(i), t};
  }
  return first;
}

}  // namespace frontier_surfels::replay
