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

/// The cells in cubes, of the smallest size at which there are few enough.
std::map<BlockKey, Cells> thinned(const Cells& cells) {
  std::map<BlockKey, Cells> cubes;
  for (int edge = 1;; ++edge) {
    cubes.clear();
    for (ClusterCell* cell : cells) {
      cubes[coarse(cell->key, edge)].push_back(cell);
      if (cubes.size() > kMostPoints) break;
    }
    if (cubes.size() <= kMostPoints) return cubes;
  }
}

/// The cell in the middle: the mean of all might lie off the boundary.
const ClusterCell& middle(const Cells& cells, const ClusterLattice& lattice) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const ClusterCell* cell : cells) mean += lattice.mean_position(*cell) / static_cast<double>(cells.size());
  const ClusterCell* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const ClusterCell* cell : cells) {
    const double distance = (lattice.mean_position(*cell) - mean).squaredNorm();
    if (distance < least) {
      least = distance;
      nearest = cell;
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
  for (const ClusterCell* cell : group.cells) {
    cluster.surfels += cell->frontier;
    centroid += lattice.mean_position(*cell) * (static_cast<double>(cell->area) / static_cast<double>(group.area));
    normal += normal_sum(*cell) / cell->frontier * (static_cast<double>(cell->area) * kAreaUnit);
  }
  cluster.centroid = centroid.cast<float>();
  cluster.normal = unit(normal, Eigen::Vector3f::UnitZ());
  cluster.area = static_cast<float>(static_cast<double>(group.area) * kAreaUnit);
  const auto corner = [&](const BlockKey& key, int more) {
    return Eigen::Vector3f((Eigen::Vector3d(key.x + more, key.y + more, key.z + more) * lattice.cell()).cast<float>());
  };
  cluster.box = {corner(group.box.low, 0), corner(group.box.high, 1)};
  for (const auto& [key, cells] : thinned(group.cells)) {
    const ClusterCell& cell = middle(cells, lattice);
    cluster.points.push_back({lattice.mean_position(cell).cast<float>(), unit(normal_sum(cell), cluster.normal)});
  }
  cluster.touches_occupied = near_occupied(group.cells);
  return cluster;
}

}  // namespace frontier_surfels
