/// Questions for the tests of what planners ask.
#pragma once

#include <random>

#include "mapper_input.hpp"

namespace frontier_surfels {

using Points = std::vector<Eigen::Vector3f>;

inline Points random_points(std::size_t count, unsigned seed, const Eigen::AlignedBox3f& box) {
  std::mt19937 random(seed);
  Points points;
  for (std::size_t n = 0; n < count; ++n) {
    Eigen::Vector3f share;
    for (int axis = 0; axis < 3; ++axis) share[axis] = std::uniform_real_distribution<float>(0, 1)(random);
    points.push_back(box.min() + share.cwiseProduct(box.sizes()));
  }
  return points;
}

/// All that the room's frames may see, and some of what they cannot.
inline Eigen::AlignedBox3f box_around(const std::vector<Surfel>& surfels) {
  Eigen::AlignedBox3f box;
  for (const Surfel& surfel : surfels) box.extend(surfel.position);
  return {box.min() - Eigen::Vector3f::Constant(0.3F), box.max() + Eigen::Vector3f::Constant(0.3F)};
}

inline Config as_recorded() {
  Config config = undecimated();
  config.correct_poses = false;
  return config;
}

/// A map of the room that has forgotten half of its views. Made by the first test that asks for it.
inline const Mapper& room_mapper() {
  static const Mapper mapper = [] {
    Config config = as_recorded();
    config.recent_views = 6;
    Mapper made(config);
    integrate_all(made, orbit_frames(coarse_camera(), 12, 12));
    return made;
  }();
  return mapper;
}

}  // namespace frontier_surfels
