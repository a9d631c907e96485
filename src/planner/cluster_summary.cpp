#include "planner/cluster_summary.hpp"

#include <algorithm>
#include <array>
#include <limits>

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

/// A cell with the mean position of its surfels, world frame [m], and the cube that it lies in.
struct Place {
  const ClusterCell* cell = nullptr;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::size_t cube = 0;
};
using Places = std::vector<Place>;

/// Cubes of cells, found by their keys.
class Cubes {
 public:
  struct Cube {
    BlockKey key;
    std::size_t cells = 0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();  ///< of its places [m]
    const Place* middle = nullptr;                   ///< the place next to it
    double least = std::numeric_limits<double>::infinity();
  };

  /// Number of the cube with this key; kMostPoints if there would be too many.
  std::size_t number_of(const BlockKey& key) {
    std::size_t slot = std::hash<BlockKey>()(key) % kSlots;
    for (; slots_[slot] != 0; slot = (slot + 1) % kSlots)
      if (cubes_[slots_[slot] - 1].key == key) return slots_[slot] - 1U;
    if (count_ == kMostPoints) return kMostPoints;
    cubes_[count_].key = key;
    slots_[slot] = static_cast<std::uint8_t>(++count_);
    return count_ - 1;
  }

  Cube& operator[](std::size_t number) { return cubes_[number]; }

  /// All cubes, by key.
  std::vector<const Cube*> sorted() const {
    std::vector<const Cube*> all;
    for (std::size_t n = 0; n < count_; ++n) all.push_back(&cubes_[n]);
    std::sort(all.begin(), all.end(), [](const Cube* a, const Cube* b) { return a->key < b->key; });
    return all;
  }

 private:
  static constexpr std::size_t kSlots = 4 * kMostPoints;
  std::array<std::uint8_t, kSlots> slots_ = {};  ///< number of a cube + 1; 0: none
  std::array<Cube, kMostPoints> cubes_;
  std::size_t count_ = 0;
};

/// Finds the cubes of an edge [cell] that places lie in. @return false  there are more than kMostPoints
bool put_in_cubes(Places& places, int edge, Cubes& cubes) {
  BlockKey last;
  const Place* before = nullptr;  // cells that follow each other often lie in the same cube
  for (Place& place : places) {
    const BlockKey key = coarse(place.cell->key, edge);
    place.cube = before != nullptr && key == last ? before->cube : cubes.number_of(key);
    if (place.cube == kMostPoints) return false;
    ++cubes[place.cube].cells;
    last = key;
    before = &place;
  }
  return true;
}

/// The cells in the middle of cubes of the smallest size at which there are few enough; the mean of all might lie off the boundary.
std::vector<const Place*> thinned(Places& places) {
  int edge = 1;
  while (kMostPoints * edge * edge * edge < places.size()) ++edge;  // even full cubes would be too many
  Cubes cubes;
  while (!put_in_cubes(places, edge++, cubes)) cubes = {};
  for (const Place& place : places) cubes[place.cube].mean += place.position / static_cast<double>(cubes[place.cube].cells);
  for (const Place& place : places) {
    Cubes::Cube& cube = cubes[place.cube];
    const double distance = (place.position - cube.mean).squaredNorm();
    if (distance >= cube.least) continue;
    cube.least = distance;
    cube.middle = &place;
  }
  std::vector<const Place*> middles;
  for (const Cubes::Cube* cube : cubes.sorted()) middles.push_back(cube->middle);
  return middles;
}

bool near_occupied(const Cells& cells) {
  for (const ClusterCell* cell : cells)  // the quick way first
    if (cell->occupied > 0) return true;
  for (const ClusterCell* cell : cells) {
    bool found = false;
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
    places.push_back({cell, lattice.mean_position(*cell), 0});
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
  for (const Place* place : thinned(places))
    cluster.points.push_back({place->position.cast<float>(), unit(normal_sum(*place->cell), cluster.normal)});
  cluster.touches_occupied = near_occupied(group.cells);
  return cluster;
}

}  // namespace frontier_surfels
