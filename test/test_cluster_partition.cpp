/// Cells and clusters under random changes, against slow and obvious answers.

#include <gtest/gtest.h>

#include <deque>
#include <random>
#include <set>

#include "clusters_input.hpp"
#include "planner/cluster_partition.hpp"

namespace frontier_surfels {
namespace {

constexpr double kCell = 0.05;

struct Clustering {
  ClusterLattice lattice{kCell};
  ClusterPartition partition;

  Clustering(int max_extent, double min_area) : partition(max_extent, std::llround(min_area / kAreaUnit)) {}
  std::set<std::uint32_t> follow(const Changes& changes) {
    lattice.apply(changes);
    if (changes.since == 0) partition.clear();
    const auto cells = lattice.take_changed();
    const auto ids = partition.update(cells);
    lattice.forget_empty(cells);
    return ids;
  }
};

/// Adds and removes random patches, thin and thick, also around the origin, where cells have negative keys.
void change(World& world, std::mt19937& random) {
  std::uniform_real_distribution<float> at(-0.8F, 0.8F), half(0.02F, 0.4F), share(0, 1);
  const auto box = [&] {
    const Eigen::Vector3f centre(at(random), at(random), 0.3F * at(random)), size(half(random), half(random), 0.3F * half(random));
    return Eigen::AlignedBox3f(centre - size, centre + size);
  };
  const Eigen::AlignedBox3f gone = box(), fresh = box();
  world.remove_if([&](const Surfel& s) { return gone.contains(s.position); });
  std::vector<Eigen::Vector3f> points;
  const int count = static_cast<int>(300 * share(random));
  for (int n = 0; n < count; ++n)
    points.push_back(fresh.min() + Eigen::Vector3f(share(random), share(random), share(random)).cwiseProduct(fresh.sizes()));
  world.add(points, share(random) < 0.2F ? Label::kOccupied : Label::kFrontier);
}

BlockKey key_of(const Eigen::Vector3f& p) {
  const auto down = [](float x) { return static_cast<int>(std::floor(static_cast<double>(x) / kCell)); };
  return {down(p.x()), down(p.y()), down(p.z())};
}

std::map<BlockKey, std::vector<Surfel>> cells_of(const World& world) {
  std::map<BlockKey, std::vector<Surfel>> cells;
  for (const Surfel& s : world.surfels())
    if (s.label == Label::kFrontier) cells[key_of(s.position)].push_back(s);
  return cells;
}

/// Connected parts of a set of cells, by its definition.
std::set<std::set<BlockKey>> connected(std::set<BlockKey> open) {
  std::set<std::set<BlockKey>> parts;
  while (!open.empty()) {
    std::deque<BlockKey> next = {*open.begin()};
    open.erase(open.begin());
    std::set<BlockKey> part;
    for (; !next.empty(); next.pop_front()) {
      part.insert(next.front());
      for (int n = 0; n < 27; ++n) {
        const BlockKey other = {next.front().x + n % 3 - 1, next.front().y + n / 3 % 3 - 1, next.front().z + n / 9 - 1};
        if (open.erase(other) > 0) next.push_back(other);
      }
    }
    parts.insert(part);
  }
  return parts;
}

std::set<std::set<BlockKey>> clusters_of(const ClusterPartition& partition) {
  std::set<std::set<BlockKey>> all;
  for (const auto& [id, group] : partition.groups()) {
    std::set<BlockKey> keys;
    for (const ClusterCell* cell : group.cells) keys.insert(cell->key);
    all.insert(keys);
  }
  return all;
}

TEST(ClusterPartition, InvariantsHoldUnderRandomChanges) {
  std::mt19937 random(1);
  World world;
  Clustering clustering(10, 0.02);
  std::map<std::uint32_t, std::set<BlockKey>> before;
  std::size_t divided = 0;
  for (int round = 0; round < 300; ++round) {
    change(world, random);
    if (round % 60 == 59) world.remove_if([](const Surfel&) { return true; });
    const auto ids = clustering.follow(round % 97 == 96 ? world.whole() : world.take());

    const auto cells = cells_of(world);
    std::map<BlockKey, std::uint32_t> owner;
    std::map<std::uint32_t, std::set<BlockKey>> now;
    for (const auto& [id, group] : clustering.partition.groups()) {
      ASSERT_FALSE(group.cells.empty());
      ASSERT_TRUE(std::is_sorted(group.cells.begin(), group.cells.end(), [](auto* a, auto* b) { return a->key < b->key; }));
      std::int64_t area = 0;
      CellBox box(group.cells[0]->key);
      for (const ClusterCell* cell : group.cells) {
        ASSERT_TRUE(owner.emplace(cell->key, id).second) << "a cell in two clusters, in round " << round;
        ASSERT_EQ(cell->cluster, id);
        area += cell->area;
        box.extend(CellBox(cell->key));
        now[id].insert(cell->key);
        const auto found = cells.find(cell->key);
        ASSERT_NE(found, cells.end()) << "a cell without frontier";
        ASSERT_EQ(cell->frontier, found->second.size());
        Eigen::Vector3d mean = Eigen::Vector3d::Zero();
        for (const Surfel& s : found->second) mean += s.position.cast<double>() / static_cast<double>(found->second.size());
        ASSERT_LT((clustering.lattice.mean_position(*cell) - mean).norm(), 1e-6);
      }
      ASSERT_EQ(group.area, area);
      ASSERT_TRUE(group.box.low == box.low && group.box.high == box.high);
      ASSERT_LE(group.box.longest_edge(), 10);
      ASSERT_EQ(connected(now[id]).size(), 1U) << "cluster " << id << " is not connected in round " << round;
      const bool is_same = before.count(id) > 0 && before[id] == now[id];
      ASSERT_TRUE(is_same || ids.count(id) > 0) << "a change was not told";
    }
    ASSERT_EQ(owner.size(), cells.size()) << "every cell with frontier is in a cluster";
    divided += connected([&] {
                 std::set<BlockKey> all;
                 for (const auto& [key, s] : cells) all.insert(key);
                 return all;
               }())
                   .size() < now.size();
    before = now;
  }
  EXPECT_GT(divided, 50U) << "else the extent was never in question";
}

TEST(ClusterPartition, IsConnectivityWhereNothingLimitsIt) {
  std::mt19937 random(2);
  World world;
  Clustering clustering(1000000, 1e5);  // all are small, so that those that touch are one
  std::size_t most = 0;
  for (int round = 0; round < 300; ++round) {
    change(world, random);
    clustering.follow(world.take());
    std::set<BlockKey> keys;
    for (const auto& [key, surfels] : cells_of(world)) keys.insert(key);
    ASSERT_EQ(clusters_of(clustering.partition), connected(keys)) << "round " << round;
    most = std::max(most, clustering.partition.groups().size());
  }
  EXPECT_GT(most, 5U);
}

TEST(ClusterPartition, SmallClustersJoinAnyNeighbourWithRoom) {
  std::mt19937 random(3);
  World world;
  const double min_area = 0.02;
  const int extent = 12;
  Clustering clustering(extent, min_area);
  for (int round = 0; round < 200; ++round) {
    change(world, random);
    clustering.follow(world.take());
    for (const auto& [id, group] : clustering.partition.groups()) {
      if (static_cast<double>(group.area) * kAreaUnit >= min_area) continue;
      for (const ClusterCell* cell : group.cells)
        ClusterLattice::for_neighbours(*cell, [&, id = id, &group = group](const ClusterCell& other) {
          if (other.cluster == 0 || other.cluster == id) return;
          CellBox box = group.box;
          box.extend(clustering.partition.groups().at(other.cluster).box);
          ASSERT_GT(box.longest_edge(), extent) << "cluster " << id << " has room in " << other.cluster << ", in round " << round;
        });
    }
  }
}

/// The order in which surfels are told says nothing, and neither do rounds that change nothing in the end.
TEST(ClusterPartition, SameChangesInAnotherOrderGiveTheSame) {
  std::mt19937 random(4);
  World world;
  FrontierClusters one, other;
  for (int round = 0; round < 60; ++round) {
    change(world, random);
    Changes changes = world.take();
    one.apply(changes);
    std::reverse(changes.updated.begin(), changes.updated.end());
    std::reverse(changes.removed.begin(), changes.removed.end());
    other.apply(changes);
    Changes again = changes;
    again.since = changes.sequence;
    again.removed.clear();
    other.apply(again);
    const ClusterChanges a = one.update(AllFree()), b = other.update(AllFree());
    ASSERT_EQ(text(a.updated), text(b.updated)) << "round " << round;
    ASSERT_EQ(a.removed, b.removed);
    ASSERT_EQ(text(one.clusters()), text(other.clusters()));
  }
}

/// Who keeps a copy by updates and removals has the same as who asks for all.
TEST(ClusterPartition, ChangesAreComplete) {
  std::mt19937 random(5);
  World world;
  FrontierClusters clusters;
  std::map<std::uint32_t, Cluster> copy;
  for (int round = 0; round < 60; ++round) {
    change(world, random);
    clusters.apply(round == 40 ? world.whole() : world.take());
    const ClusterChanges changes = clusters.update(AllFree());
    for (const std::uint32_t id : changes.removed) ASSERT_EQ(copy.erase(id), 1U) << "removed, but never told";
    for (const Cluster& cluster : changes.updated) copy[cluster.id] = cluster;
    std::vector<Cluster> copied;
    for (const auto& [id, cluster] : copy) copied.push_back(cluster);
    ASSERT_EQ(text(copied), text(clusters.clusters())) << "round " << round;
  }
}

}  // namespace
}  // namespace frontier_surfels
