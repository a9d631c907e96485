/// What is asked of many places at once, in parts that lie near each other.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"

namespace frontier_surfels {

constexpr int kRegionBlocks = 8;      ///< of the map, along a region's edge
constexpr float kFarthest = 1e6F;     ///< nothing is mapped beyond, along any axis [m]
constexpr double kMostAsked = 100e6;  ///< points, or samples, of one question

/// The block in which a point of the world [m] lies.
inline BlockKey block_at(const Eigen::Vector3d& point_world, double block_size) {
  const Eigen::Array3i at = (point_world / block_size).array().floor().cast<int>();
  return {at.x(), at.y(), at.z()};
}

/// Numbers of the points in each region, ascending. Points beyond the map are left out.
/// @param consequence  end of the sentence for a point that is not finite. @throws Error  there is such a point
inline std::map<BlockKey, std::vector<std::uint32_t>> by_region(const std::vector<Eigen::Vector3f>& points_world, double block_size,
                                                                const std::string& consequence) {
  std::map<BlockKey, std::vector<std::uint32_t>> regions;
  BlockKey last = {};
  std::vector<std::uint32_t>* numbers = nullptr;
  for (std::uint32_t n = 0; n < points_world.size(); ++n) {
    if (!points_world[n].allFinite()) throw Error("Point " + std::to_string(n) + " is not finite, so that " + consequence);
    if (points_world[n].cwiseAbs().maxCoeff() > kFarthest) continue;
    const BlockKey region = block_at(points_world[n].cast<double>(), kRegionBlocks * block_size);
    if (numbers == nullptr || region != last) numbers = &regions[region];
    last = region;
    numbers->push_back(n);
  }
  return regions;
}

}  // namespace frontier_surfels
