#include "planner/cluster_summary.hpp"

#include <limits>
#include <map>

#include "planner/rounding.hpp"

namespace frontier_surfels {
namespace {

using Cells = ClusterPartition::Cells;

constexpr std::size_t kMostPoints = 64;

Eigen::Vector3f unit(const Eigen::Vector3d& v, const Eigen::Vector3f& otherwise) {
  return v.norm() > 1e-6 ? Eigen::Vector3f(v.normalized().cast<float>()) : otherwise;
}

Eigen::Vector3d normal_sum(const ClusterCell& cell) {
  return Eigen::Vector3d(static_cast<double>(cell.normal[0]), static_cast<double>(cell.normal[1]), static_cast<double>(cell.normal[2])) *
         kNormalUnit;
}

BlockKey coarse(const BlockKey& key, int edge) { return {divide_down(key.x, edge), divide_down(key.y, edge), divide_down(key.z, edge)}; }

/// A cell with the mean position of its surfels, world frame [m].
struct Place {
  const ClusterCell* cell = nullptr;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
};
using Places = std::vector<Place>;

/// The cells in cubes of an edge [cell]; none if that makes more than kMostPoints.
std::map<BlockKey, Places> in_cubes(const Places& places, int edge) {
  std::map<BlockKey, Places> cubes;
  auto last = cubes.end();  // cells that follow each other often lie in the same cube
  for (const Place& place : places) {
    const BlockKey cube = coarse(place.cell->key, edge);
    if (last == cubes.end() || last->first != cube) last = cubes.try_emplace(cube).first;
    last->second.push_back(place);
    if (cubes.size() > kMostPoints) return {};
  }
  return cubes;
}

/// The cells in cubes, of the smallest size at which there are few enough.
std::map<BlockKey, Places> thinned(const Places& places) {
  int edge = 1;
  while (kMostPoints * edge * edge * edge < places.size()) ++edge;  // even full cubes would be too many
  for (;; ++edge) {
    std::map<BlockKey, Places> cubes = in_cubes(places, edge);
    if (!cubes.empty()) return cubes;
  }
}

/// The cell in the middle: the mean of all might lie off the boundary.
const Place& middle(const Places& places) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Place& place : places) mean += place.position / static_cast<double>(places.size());
  const Place* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Place& place : places) {
    const double distance = (place.position - mean).squaredNorm();
    if (distance < least) {
      least = distance;
      nearest = &place;
    }
  }
  return *nearest;
}

bool near_occupied(const Cells& cells) {
  for (const ClusterCell* cell : cells) {
    bool found = cell->occupied > 0;
    ClusterLattice::for_neighbours(*cell, [&](const ClusterCell& other) { found = found || other.occupied > 0; });
    if (found) return true;
  }
  return false;
}

}  // namespace

Cluster summary(std::uint32_t id, const ClusterPartition::Group& group, const ClusterLattice& lattice) {
  Cluster cluster;
  cluster.id = id;
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
  Places places;
  places.reserve(group.cells.size());
  for (const ClusterCell* cell : group.cells) {
    places.push_back({cell, lattice.mean_position(*cell)});
    cluster.surfels += cell->frontier;
    centroid += places.back().position * (static_cast<double>(cell->area) / static_cast<double>(group.area));
    normal += normal_sum(*cell) / cell->frontier * (static_cast<double>(cell->area) * kAreaUnit);
  }
  cluster.centroid = centroid.cast<float>();
  cluster.normal = unit(normal, Eigen::Vector3f::UnitZ());
  cluster.area = static_cast<float>(static_cast<double>(group.area) * kAreaUnit);
  const auto corner = [&](const BlockKey& key, int more) {
    return Eigen::Vector3f((Eigen::Vector3d(key.x + more, key.y + more, key.z + more) * lattice.cell()).cast<float>());
  };
  cluster.box = {corner(group.box.low, 0), corner(group.box.high, 1)};
  for (const auto& [key, some] : thinned(places)) {
    const Place& place = middle(some);
    cluster.points.push_back({place.position.cast<float>(), unit(normal_sum(*place.cell), cluster.normal)});
  }
  cluster.touches_occupied = near_occupied(group.cells);
  return cluster;
}

}  // namespace frontier_surfels
