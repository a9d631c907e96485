/// Clusters of frontier surfels as planners get them: ids, viewpoints, work, errors.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "clusters_input.hpp"

namespace frontier_surfels {
namespace {

/// A slanted wall far from lattice planes: width along x, from x to x + width, 0.6 m high.
std::vector<Eigen::Vector3f> wall(float x, float width, float y = 0.512F) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < std::lround(width / kSpacing); ++i)
    for (int k = 0; k < std::lround(0.6F / kSpacing); ++k)
      points.emplace_back(x + (static_cast<float>(i) + 0.5F) * kSpacing, y, (static_cast<float>(k) + 0.5F) * kSpacing);
  return points;
}

std::vector<std::uint32_t> ids(const std::vector<Cluster>& clusters) {
  std::vector<std::uint32_t> all;
  for (const Cluster& cluster : clusters) all.push_back(cluster.id);
  return all;
}

using Ids = std::vector<std::uint32_t>;

TEST(Clusters, BadConfigNamesEveryProblem) {
  ClusterConfig config;
  EXPECT_TRUE(config.problems().empty());
  config.cell = std::nan("");
  config.min_area = -1;
  config.max_extent = std::numeric_limits<double>::infinity();
  config.view_distance = 0;
  config.clearance = 11;
  EXPECT_EQ(config.problems().size(), 5U);
  try {
    FrontierClusters clusters(config);
    FAIL() << "it must be refused";
  } catch (const Error& error) {
    for (const char* name : {"cell", "min_area", "max_extent", "view_distance", "clearance"})
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << name;
  }
  config = {};
  config.max_extent = 1.9 * config.cell;
  EXPECT_EQ(config.problems().size(), 1U);
}

TEST(Clusters, BadSurfelsAndGapsChangeNothing) {
  World world;
  world.add(wall(0, 0.5F));
  FrontierClusters clusters;
  clusters.apply(world.take());
  clusters.update(AllFree());
  const auto before = clusters.clusters();
  const std::uint64_t sequence = clusters.sequence();

  Changes bad;
  bad.since = sequence;
  bad.sequence = sequence + 1;
  bad.removed = {1, 2, 3};
  bad.updated.push_back(frontier(1000, {0, 0, 0}));
  for (int what = 0; what < 5; ++what) {
    Surfel& s = bad.updated[0] = frontier(1000, {0, 0, 0});
    if (what == 0) s.position.x() = std::nanf("");
    if (what == 1) s.position.y() = 1e9F;
    if (what == 2) s.normal.z() = std::numeric_limits<float>::infinity();
    if (what == 3) s.radius = std::nanf("");
    if (what == 4) s.radius = 0;
    EXPECT_THROW(clusters.apply(bad), Error) << what;
  }
  bad.updated.clear();
  bad.since = sequence + 1;
  EXPECT_THROW(clusters.apply(bad), Error);
  const ClusterChanges changes = clusters.update(AllFree());
  EXPECT_TRUE(changes.updated.empty());
  EXPECT_TRUE(changes.removed.empty());
  EXPECT_EQ(clusters.sequence(), sequence);
  EXPECT_EQ(text(clusters.clusters()), text(before));
}

/// They may come twice, or in the wrong order, from a topic.
TEST(Clusters, OldChangesAreIgnored) {
  World world;
  world.add(wall(0, 0.5F));
  FrontierClusters clusters;
  clusters.apply(world.take());
  world.add(wall(0.5F, 0.8F));
  const Changes growth = world.take();
  clusters.apply(growth);
  world.remove_if([](const Surfel& s) { return s.position.x() > 0.5F; });
  clusters.apply(world.take());
  clusters.update(AllFree());
  const auto before = clusters.clusters();
  const std::uint64_t sequence = clusters.sequence();

  clusters.apply(growth);
  const ClusterChanges changes = clusters.update(AllFree());
  EXPECT_EQ(changes.sequence, sequence);
  EXPECT_TRUE(changes.updated.empty());
  EXPECT_EQ(text(clusters.clusters()), text(before));
}

TEST(Clusters, SummaryOfAWall) {
  World world;
  world.add(wall(0.003F, 0.8F));
  FrontierClusters clusters;
  clusters.apply(world.take());
  const ClusterChanges changes = clusters.update(AllFree());
  ASSERT_EQ(changes.updated.size(), 1U);
  const Cluster& cluster = changes.updated[0];
  EXPECT_EQ(cluster.id, 1U);
  EXPECT_EQ(changes.sequence, clusters.sequence());
  EXPECT_NEAR(cluster.area, 0.8F * 0.6F, 1e-3F);
  EXPECT_EQ(cluster.surfels, world.size());
  EXPECT_LT((cluster.centroid - Eigen::Vector3f(0.403F, 0.512F, 0.3F)).norm(), 1e-3F);
  EXPECT_LT((cluster.normal - Eigen::Vector3f(0, -1, 0)).norm(), 1e-5F);
  EXPECT_FALSE(cluster.touches_occupied);
  EXPECT_GE(cluster.points.size(), 16U);
  EXPECT_LE(cluster.points.size(), 64U);
  for (const ClusterPoint& point : cluster.points) EXPECT_NEAR(point.position.y(), 0.512F, 1e-4F);
  for (const Surfel& surfel : world.surfels()) EXPECT_TRUE(cluster.box.contains(surfel.position));

  world.add({{0.4F, 0.56F, 0.3F}}, Label::kOccupied);  // in the next cell
  clusters.apply(world.take());
  EXPECT_TRUE(clusters.update(AllFree()).updated.at(0).touches_occupied);
  world.remove_if([](const Surfel& s) { return s.label == Label::kOccupied; });
  clusters.apply(world.take());
  EXPECT_FALSE(clusters.update(AllFree()).updated.at(0).touches_occupied);
}

TEST(Clusters, IdsStayInGrowthAndEndWithTheirSurfels) {
  World world;
  FrontierClusters clusters;
  const auto step = [&] {
    clusters.apply(world.take());
    return clusters.update(AllFree());
  };
  world.add(wall(0, 0.3F));
  EXPECT_EQ(ids(step().updated), Ids({1}));
  world.add(wall(0.3F, 0.4F));  // grows within the largest extent
  EXPECT_EQ(ids(step().updated), Ids({1}));
  EXPECT_NEAR(clusters.clusters().at(0).area, 0.42F, 1e-3F);
  world.add(wall(0.7F, 0.7F));  // and beyond it
  step();
  EXPECT_EQ(ids(clusters.clusters()), Ids({1, 2}));
  EXPECT_NEAR(clusters.clusters().at(0).area, 0.6F, 1e-3F);

  // The frontier wanders: what lives on keeps its number.
  world.remove_if([](const Surfel& s) { return s.position.x() < 0.5F; });
  EXPECT_TRUE(step().removed.empty());
  EXPECT_EQ(ids(clusters.clusters()), Ids({1, 2}));
  world.remove_if([](const Surfel&) { return true; });
  EXPECT_EQ(step().removed, Ids({1, 2}));
  EXPECT_TRUE(clusters.clusters().empty());
  world.add(wall(0, 0.3F));
  EXPECT_EQ(ids(step().updated), Ids({3})) << "ids are never given again";
}

TEST(Clusters, LargestPartKeepsTheIdAndSmallOnesMerge) {
  World world;
  FrontierClusters clusters;
  const auto step = [&] {
    clusters.apply(world.take());
    return clusters.update(AllFree());
  };
  world.add(wall(0, 0.9F));
  step();
  world.remove_if([](const Surfel& s) { return s.position.x() > 0.3F && s.position.x() < 0.4F; });
  const ClusterChanges split = step();
  EXPECT_EQ(ids(split.updated), Ids({1, 2}));
  EXPECT_GT(clusters.clusters().at(0).centroid.x(), 0.4F) << "the larger part is the right one";

  // The left part shrinks below the smallest area, where it is not reported, and is one with the other when they meet.
  world.remove_if([](const Surfel& s) { return s.position.x() < 0.28F; });
  EXPECT_EQ(step().removed, Ids({2}));
  EXPECT_EQ(ids(clusters.clusters()), Ids({1}));
  world.add(wall(0.3F, 0.1F));
  step();
  ASSERT_EQ(ids(clusters.clusters()), Ids({1}));
  EXPECT_NEAR(clusters.clusters().at(0).area, 0.62F * 0.6F, 1e-3F);
}

TEST(Clusters, AWholeMapReplacesAll) {
  World world;
  world.add(wall(0, 0.5F));
  FrontierClusters clusters;
  clusters.apply(world.take());
  clusters.update(AllFree());
  clusters.apply(world.whole());
  const ClusterChanges changes = clusters.update(AllFree());
  EXPECT_EQ(changes.removed, Ids({1}));
  EXPECT_EQ(ids(changes.updated), Ids({2}));
  Changes empty;
  empty.sequence = clusters.sequence() + 1;
  clusters.apply(empty);
  EXPECT_EQ(clusters.update(AllFree()).removed, Ids({2}));
  EXPECT_TRUE(clusters.clusters().empty());
}

TEST(Clusters, NoWorkWhereNothingHasChanged) {
  World world;
  for (int n = 0; n < 20; ++n) world.add(wall(0, 0.9F, static_cast<float>(n)));
  FrontierClusters clusters;
  clusters.apply(world.take());
  clusters.update(AllFree());
  const std::size_t all = clusters.visited_cells();
  EXPECT_GT(all, 20U * 200U);

  Changes repeated = world.whole();  // unchanged surfels, and ids that never were
  repeated.since = clusters.sequence();
  repeated.removed = {900000, 4000000000};
  clusters.apply(repeated);
  const ClusterChanges changes = clusters.update(AllFree());
  EXPECT_TRUE(changes.updated.empty());
  EXPECT_TRUE(changes.removed.empty());
  EXPECT_EQ(clusters.visited_cells(), 0U);

  world.remove_if([](const Surfel& s) { return s.position.y() < 1 && s.position.x() < 0.1F; });
  clusters.apply(world.take());
  EXPECT_EQ(clusters.update(AllFree()).updated.size(), 1U);
  EXPECT_GT(clusters.visited_cells(), 0U);
  EXPECT_LT(clusters.visited_cells(), all / 10) << "one cluster of twenty";
}

/// Free but for a wall of unknown behind y = 0.5, and a solid box.
struct Room : Space {
  Eigen::AlignedBox3f solid{Eigen::Vector3f(0.2F, -0.5F, -1), Eigen::Vector3f(0.5F, -0.3F, 2)};
  bool is_free(const Eigen::Vector3f& p) const override { return p.y() < 0.5F && !solid.contains(p); }
  float clearance(const Eigen::Vector3f& p, float most) const override {
    return std::min({most, std::max(0.0F, 0.5F - p.y()), solid.exteriorDistance(p)});
  }
  bool sees(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const override {
    for (int n = 0; n <= 200; ++n)
      if (!is_free(from + (to - from) * (static_cast<float>(n) / 200))) return false;
    return true;
  }
};

TEST(Clusters, ViewpointsAreInTheClearAndSeeWhatTheySay) {
  World world;
  world.add(wall(0, 0.9F));
  FrontierClusters clusters;
  clusters.apply(world.take());
  const Room room;
  clusters.update(room);
  const Cluster cluster = clusters.clusters().at(0);
  ASSERT_EQ(cluster.viewpoints.size(), 3U);
  for (const ClusterViewpoint& view : cluster.viewpoints) {
    const Eigen::Vector3f eye = view.T_world_camera.translation(), forward = view.T_world_camera.linear().col(2);
    EXPECT_TRUE(room.is_free(eye));
    EXPECT_GE(view.clearance, 0.3F);
    EXPECT_NEAR(view.clearance, room.clearance(eye, 0.6F), 1e-6F);
    EXPECT_NEAR(view.T_world_camera.linear().determinant(), 1, 1e-5F);
    EXPECT_NEAR(view.T_world_camera.linear()(2, 0), 0, 1e-6F) << "no roll";
    EXPECT_LE(view.T_world_camera.linear()(2, 1), 0) << "y points down";
    EXPECT_LT(forward.cross(cluster.centroid - eye).norm(), 1e-4F) << "looks at the centroid";
    int seen = 0;
    for (const ClusterPoint& point : cluster.points) {
      const Eigen::Vector3f p = view.T_world_camera.inverse() * point.position;
      const bool in_image = std::abs(p.x()) <= std::tan(29 * M_PI / 180) * p.z() && std::abs(p.y()) <= std::tan(22.5 * M_PI / 180) * p.z();
      seen += in_image && point.normal.dot(eye - point.position) > 0 &&
              room.sees(eye, point.position - 0.1F * (point.position - eye).normalized());
    }
    EXPECT_NEAR(view.value, cluster.area * static_cast<float>(seen) / static_cast<float>(cluster.points.size()), 1e-5F);
    EXPECT_GT(view.value, 0.3F * cluster.area);
  }
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < a; ++b) {
      EXPECT_GE(cluster.viewpoints[b].value, cluster.viewpoints[a].value);
      EXPECT_GE((cluster.viewpoints[a].T_world_camera.translation() - cluster.viewpoints[b].T_world_camera.translation()).norm(), 0.3F);
    }
}

/// A room in which nothing is free where the first viewpoint was.
struct Shut : Room {
  Eigen::Vector3f at;
  float clearance(const Eigen::Vector3f& p, float most) const override { return std::min(Room::clearance(p, most), (p - at).norm()); }
};

TEST(Clusters, ViewpointsFollowTheSpace) {
  World world;
  world.add(wall(0, 0.9F));
  FrontierClusters clusters;
  clusters.apply(world.take());
  clusters.update(Room());
  EXPECT_TRUE(clusters.update(Room()).updated.empty());
  Shut shut;
  shut.at = clusters.clusters().at(0).viewpoints.at(0).T_world_camera.translation();
  ASSERT_EQ(clusters.update(shut).updated.size(), 1U);
  const std::vector<Cluster> elsewhere = clusters.clusters();
  for (const ClusterViewpoint& view : elsewhere.at(0).viewpoints) EXPECT_GE((view.T_world_camera.translation() - shut.at).norm(), 0.3F);

  struct Nothing : AllFree {
    bool is_free(const Eigen::Vector3f&) const override { return false; }
  };
  ASSERT_EQ(clusters.update(Nothing()).updated.size(), 1U);
  EXPECT_TRUE(clusters.clusters().at(0).viewpoints.empty());
  ASSERT_EQ(clusters.update(Room()).updated.size(), 1U) << "it has room again";
  EXPECT_EQ(clusters.clusters().at(0).viewpoints.size(), 3U);
}

/// Something comes between the cluster and its viewpoints, which stay in the clear.
TEST(Clusters, ValuesFollowTheSpace) {
  World world;
  world.add(wall(0, 0.9F));
  FrontierClusters clusters;
  clusters.apply(world.take());
  clusters.update(AllFree());
  const float value = clusters.clusters().at(0).viewpoints.at(0).value;

  struct Screen : AllFree {
    float left = 0;  ///< [m] it hides what lies to the right of this
    bool sees(const Eigen::Vector3f&, const Eigen::Vector3f& to) const override { return to.x() < left; }
  } screen;
  screen.left = 0.45F;
  ASSERT_EQ(clusters.update(screen).updated.size(), 1U);
  ASSERT_FALSE(clusters.clusters().at(0).viewpoints.empty());
  const std::vector<Cluster> hidden = clusters.clusters();
  for (const ClusterViewpoint& view : hidden.at(0).viewpoints) EXPECT_LT(view.value, 0.7F * value);
  screen.left = -1;
  ASSERT_EQ(clusters.update(screen).updated.size(), 1U);
  EXPECT_TRUE(clusters.clusters().at(0).viewpoints.empty());
  ASSERT_EQ(clusters.update(AllFree()).updated.size(), 1U);
  EXPECT_FLOAT_EQ(clusters.clusters().at(0).viewpoints.at(0).value, value);
}

}  // namespace
}  // namespace frontier_surfels
