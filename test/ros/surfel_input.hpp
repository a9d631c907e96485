/// Random surfels and changes for the tests of the outputs.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <set>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

using Rng = std::mt19937;

inline float uniform(Rng& rng, float low, float high) { return std::uniform_real_distribution<float>(low, high)(rng); }

/// A surfel whose coordinates are at most `extent` metres; every third one has no colour.
inline Surfel random_surfel(Rng& rng, std::uint32_t id, float extent = 2) {
  Surfel surfel;
  for (int axis = 0; axis < 3; ++axis) {
    surfel.position[axis] = uniform(rng, -extent, extent);
    surfel.normal[axis] = uniform(rng, -1, 1);
  }
  surfel.normal = surfel.normal.norm() > 0.01F ? surfel.normal.normalized() : Eigen::Vector3f::UnitX();
  surfel.radius = uniform(rng, 0.003F, 0.02F);
  surfel.label = rng() % 2 == 0 ? Label::kFrontier : Label::kOccupied;
  if (rng() % 3 > 0)
    for (auto& channel : surfel.rgb) channel = static_cast<std::uint8_t>(rng());
  surfel.id = id;
  return surfel;
}

/// Surfels with the ids 0 ... count - 1.
inline std::vector<Surfel> random_surfels(Rng& rng, std::size_t count, float extent = 2) {
  std::vector<Surfel> surfels;
  for (std::size_t id = 0; id < count; ++id) surfels.push_back(random_surfel(rng, static_cast<std::uint32_t>(id), extent));
  return surfels;
}

/// Changes of the map with the number `since`. At most `count` of the ids 0 ... ids - 1 are updated or removed, none of them both.
inline Changes random_changes(Rng& rng, std::uint64_t since, std::uint32_t ids, int count) {
  std::set<std::uint32_t> changed;
  for (int n = 0; n < count; ++n) changed.insert(static_cast<std::uint32_t>(rng() % ids));
  Changes changes;
  changes.sequence = since + 1 + rng() % 3;
  for (const std::uint32_t id : changed) {
    if (rng() % 3 == 0)
      changes.removed.push_back(id);
    else
      changes.updated.push_back(random_surfel(rng, id));
  }
  return changes;
}

}  // namespace frontier_surfels
