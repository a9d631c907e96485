// The grid of states against slow, obvious answers, cell by cell.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "frontier_surfels/planner/map_client.hpp"

namespace frontier_surfels {
namespace {

constexpr double kResolution = 0.05;
constexpr int kEdge = StateBlock::kEdge;

/// What a message of ROS looks like.
struct Message {
  static constexpr std::uint8_t MIXED = 3;
  std::uint64_t sequence = 0, since = 0;
  double resolution = 0;
  std::vector<std::int32_t> blocks;
  std::vector<std::uint8_t> kinds, cells;
};

StateBlock uniform(int x, int y, int z, SpaceState state) { return {{x, y, z}, {static_cast<std::uint8_t>(state)}}; }

StateBlock random_block(int x, int y, int z, std::mt19937& random) {
  StateBlock block = {{x, y, z}, std::vector<std::uint8_t>(StateBlock::kBytes, 0)};
  for (int n = 0; n < StateBlock::kCells; ++n) {
    const unsigned kind = random() % 12;  // mostly free
    if (kind > 1) block.cells[n / 8] |= static_cast<std::uint8_t>(1 << n % 8);
    if (kind == 1) block.cells[StateBlock::kBytes / 2 + n / 8] |= static_cast<std::uint8_t>(1 << n % 8);
  }
  return block;
}

/// Blocks of all kinds around the origin, with holes.
StateChanges random_changes(std::mt19937& random, std::uint64_t sequence, std::uint64_t since) {
  StateChanges changes = {sequence, since, kResolution, {}};
  for (int x = -2; x < 2; ++x)
    for (int y = -1; y < 2; ++y)
      for (int z = -1; z < 1; ++z) switch (random() % 6) {
          case 0:
            break;
          case 1:
            changes.blocks.push_back(uniform(x, y, z, SpaceState::kFree));
            break;
          case 2:
            changes.blocks.push_back(uniform(x, y, z, SpaceState::kUnknown));
            break;
          case 3:
            changes.blocks.push_back(uniform(x, y, z, SpaceState::kOccupied));
            break;
          default:
            changes.blocks.push_back(random_block(x, y, z, random));
        }
  return changes;
}

/// The same grid as a map of cells.
struct Slow {
  std::map<std::array<int, 3>, SpaceState> cells;

  void apply(const StateChanges& changes) {
    if (changes.since == 0) cells.clear();
    for (const StateBlock& block : changes.blocks)
      for (int n = 0; n < StateBlock::kCells; ++n)
        cells[{kEdge * block.block[0] + n % kEdge, kEdge * block.block[1] + n / kEdge % kEdge, kEdge * block.block[2] + n / 256}] =
            block.state(n);
  }
  SpaceState at(int x, int y, int z) const {
    const auto found = cells.find({x, y, z});
    return found == cells.end() ? SpaceState::kUnknown : found->second;
  }
  static int cell(float x) { return static_cast<int>(std::floor(x / kResolution)); }
  SpaceState state(const Eigen::Vector3f& p) const { return at(cell(p.x()), cell(p.y()), cell(p.z())); }

  SpaceState box(const Eigen::AlignedBox3f& box) const {
    bool unknown = false;
    for (int x = cell(box.min().x()); x <= cell(box.max().x()); ++x)
      for (int y = cell(box.min().y()); y <= cell(box.max().y()); ++y)
        for (int z = cell(box.min().z()); z <= cell(box.max().z()); ++z) {
          if (at(x, y, z) == SpaceState::kOccupied) return SpaceState::kOccupied;
          unknown = unknown || at(x, y, z) == SpaceState::kUnknown;
        }
    return unknown ? SpaceState::kUnknown : SpaceState::kFree;
  }

  /// Distance to the nearest cell that is, or is not, free.
  double nearest(const Eigen::Vector3f& p, double most, bool free) const {
    double best = most;
    const int reach = static_cast<int>(most / kResolution) + 2;
    for (int x = cell(p.x()) - reach; x <= cell(p.x()) + reach; ++x)
      for (int y = cell(p.y()) - reach; y <= cell(p.y()) + reach; ++y)
        for (int z = cell(p.z()) - reach; z <= cell(p.z()) + reach; ++z) {
          if ((at(x, y, z) == SpaceState::kFree) != free) continue;
          const Eigen::Array3d low = kResolution * Eigen::Array3d(x, y, z), q = p.cast<double>();
          best = std::min(best, (low - q).max(q - low - kResolution).max(0).matrix().norm());
        }
    return best;
  }
};

Eigen::Vector3f random_point(std::mt19937& random) {
  std::uniform_real_distribution<float> x(-1.9F, 1.9F), y(-1.1F, 1.9F), z(-1.1F, 1.1F);
  const float a = x(random), b = y(random), c = z(random);
  return {a, b, c};
}

struct TestStateGrid : testing::Test {
  TestStateGrid() {
    const StateChanges changes = random_changes(random, 7, 0);
    slow.apply(changes);
    EXPECT_TRUE(grid.apply(changes));
  }
  std::mt19937 random{3};
  StateGrid grid{kResolution};
  Slow slow;
};

TEST_F(TestStateGrid, StatesOfPoints) {
  std::vector<Eigen::Vector3f> points;
  for (int n = 0; n < 20000; ++n) points.push_back(random_point(random));
  const std::vector<SpaceState> states = grid.states(points);
  for (std::size_t n = 0; n < points.size(); ++n) ASSERT_EQ(states[n], slow.state(points[n])) << points[n].transpose();
}

TEST_F(TestStateGrid, WhatIsNoPlaceIsUnknown) {
  const float nan = std::nanf(""), far = 1e30F;
  for (const Eigen::Vector3f& p : {Eigen::Vector3f(nan, 0, 0), Eigen::Vector3f(0, far, 0), Eigen::Vector3f(0, 0, -far)}) {
    EXPECT_EQ(grid.state(p), SpaceState::kUnknown);
    EXPECT_EQ(grid.clearance(p, 1), 0);
    EXPECT_EQ(grid.ray_state({p, Eigen::Vector3f::Zero()}, false).state, SpaceState::kUnknown);
    EXPECT_EQ(grid.path_state({Eigen::Vector3f::Zero(), p}, Eigen::Vector3f::Ones(), false).state, SpaceState::kUnknown);
    EXPECT_EQ(grid.box_state({p, p}), SpaceState::kUnknown);
  }
}

TEST_F(TestStateGrid, Boxes) {
  std::uniform_real_distribution<float> size(0, 0.3F);
  for (int n = 0; n < 2000; ++n) {
    const Eigen::Vector3f low = random_point(random);
    const Eigen::AlignedBox3f box(low, low + Eigen::Vector3f(4 * size(random), size(random), size(random)));
    ASSERT_EQ(grid.box_state(box), slow.box(box)) << low.transpose();
  }
}

/// A ray is asked at points far closer than cells.
TEST_F(TestStateGrid, Rays) {
  for (int n = 0; n < 500; ++n) {
    const Ray ray = {random_point(random), random_point(random)};
    const bool stop_at_unknown = n % 2 == 0;
    const RayState found = grid.ray_state(ray, stop_at_unknown);
    const float length = (ray.to - ray.from).norm();
    RayState slowly = {SpaceState::kFree, length};
    for (int m = 0; m <= 20000 && slowly.state == SpaceState::kFree; ++m) {
      const SpaceState state = slow.state(ray.from + (ray.to - ray.from) * (static_cast<float>(m) / 20000));
      if (state == SpaceState::kOccupied || (stop_at_unknown && state == SpaceState::kUnknown)) slowly = {state, length * m / 20000};
    }
    if (found.state == SpaceState::kFree || found.distance > slowly.distance - 1e-3F) {  // else it grazed a corner between two points
      ASSERT_EQ(found.state, slowly.state) << n;
      ASSERT_NEAR(found.distance, slowly.distance, 1e-3);
    } else {
      const Eigen::Vector3f at = ray.from + (ray.to - ray.from) * (found.distance / length);
      ASSERT_EQ(slow.box({at - Eigen::Vector3f::Constant(1e-4F), at + Eigen::Vector3f::Constant(1e-4F)}), found.state) << n;
    }
  }
}

TEST_F(TestStateGrid, ARayAlongAnAxisAndOneOfNoLength) {
  StateGrid free(kResolution);
  ASSERT_TRUE(free.apply({1, 0, kResolution, {uniform(0, 0, 0, SpaceState::kFree), uniform(1, 0, 0, SpaceState::kOccupied)}}));
  const Eigen::Vector3f from(0.11F, 0.4F, 0.4F);
  const RayState along = free.ray_state({from, {1.5F, 0.4F, 0.4F}}, true);
  EXPECT_EQ(along.state, SpaceState::kOccupied);
  EXPECT_NEAR(along.distance, 0.69, 1e-5);
  const RayState none = free.ray_state({from, from}, true);
  EXPECT_EQ(none.state, SpaceState::kFree);
  EXPECT_EQ(none.distance, 0);
  const RayState path = free.path_state({from, {1.5F, 0.4F, 0.4F}}, {0.2F, 0.2F, 0.2F}, true);
  EXPECT_EQ(path.state, SpaceState::kOccupied);
  EXPECT_NEAR(path.distance, 0.59, 0.026);
}

TEST_F(TestStateGrid, PathsStopWhereTheBoxDoes) {
  for (int n = 0; n < 500; ++n) {
    const Ray path = {random_point(random), random_point(random)};
    const Eigen::Vector3f size(0.12F, 0.2F, 0.07F);
    const bool stop_at_unknown = n % 2 == 0;
    const RayState found = grid.path_state(path, size, stop_at_unknown);
    const auto box_at = [&](float distance) {
      const Eigen::Vector3f at = path.from + (path.to - path.from).normalized() * distance;
      return slow.box({at - size / 2, at + size / 2});
    };
    if (found.state == SpaceState::kFree) {
      ASSERT_EQ(found.distance, (path.to - path.from).norm());
    } else if (found.distance > 0) {
      ASSERT_NE(box_at(found.distance + 1e-4F), SpaceState::kFree);
    }
    for (float d = 0; d < found.distance - 0.03F; d += 0.02F) {
      const SpaceState state = box_at(d);  // a box may graze a corner between two steps
      if (state == SpaceState::kOccupied || (stop_at_unknown && state == SpaceState::kUnknown)) {
        const SpaceState before = box_at(std::max(d - 0.025F, 0.0F)), after = box_at(d + 0.025F);
        ASSERT_TRUE(before == SpaceState::kFree || after == SpaceState::kFree || !stop_at_unknown) << n << " " << d;
      }
    }
  }
}

TEST_F(TestStateGrid, Clearance) {
  int free = 0;
  for (int n = 0; n < 300; ++n) {
    const Eigen::Vector3f p = random_point(random);
    const bool is_free = slow.state(p) == SpaceState::kFree;
    free += is_free;
    ASSERT_NEAR(grid.clearance(p, 0.3F), is_free ? slow.nearest(p, 0.3, false) : 0, 1e-5) << p.transpose();
    const NearestBoundary boundary = grid.nearest_boundary(p, 0.3F);
    const double nearest = slow.nearest(p, 0.3, !is_free);
    if (nearest >= 0.3 - 1e-6) continue;
    ASSERT_NEAR(boundary.distance, nearest, 1e-5);
    ASSERT_EQ(boundary.in_front, is_free);
    if (!is_free) {
      ASSERT_EQ(boundary.label == Label::kOccupied, slow.state(p) == SpaceState::kOccupied);
    }
  }
  EXPECT_GT(free, 50);
  EXPECT_EQ(grid.clearance(Eigen::Vector3f::Zero(), -1), 0);
}

TEST_F(TestStateGrid, ChangesAreTakenOverOneAfterTheOther) {
  for (std::uint64_t sequence = 8; sequence < 12; ++sequence) {
    const StateChanges changes = random_changes(random, sequence, sequence - 1);
    slow.apply(changes);
    ASSERT_TRUE(grid.apply(changes));
    for (int n = 0; n < 2000; ++n) {
      const Eigen::Vector3f p = random_point(random);
      ASSERT_EQ(grid.state(p), slow.state(p));
    }
  }
  StateGrid late(kResolution);
  ASSERT_TRUE(late.apply(grid.whole()));
  EXPECT_EQ(late.whole().blocks, grid.whole().blocks);
  EXPECT_EQ(late.sequence(), 11U);
}

TEST_F(TestStateGrid, OnlyWhatIsDifferentIsTold) {
  StateGrid follower(kResolution);
  ASSERT_TRUE(follower.apply(grid.whole()));
  StateChanges candidates = random_changes(random, 8, 7);
  const StateChanges told = grid.take(candidates);
  EXPECT_LT(told.blocks.size(), candidates.blocks.size());  // some are unknown, and were so
  EXPECT_TRUE(grid.take({9, 8, kResolution, candidates.blocks}).blocks.empty());
  ASSERT_TRUE(follower.apply(told));
  EXPECT_EQ(follower.whole().blocks, grid.whole().blocks);
}

TEST_F(TestStateGrid, GapsAreTold) {
  const auto before = grid.whole().blocks;
  EXPECT_FALSE(grid.apply({20, 19, kResolution, {uniform(0, 0, 0, SpaceState::kFree)}}));
  EXPECT_TRUE(grid.apply({6, 5, kResolution, {uniform(0, 0, 0, SpaceState::kFree)}}));  // old
  EXPECT_EQ(grid.whole().blocks, before);
  EXPECT_EQ(grid.sequence(), 7U);
}

TEST_F(TestStateGrid, DamagedChangesAreRefused) {
  const auto before = grid.whole().blocks;
  const auto refused = [&](const StateChanges& changes) {
    EXPECT_THROW(grid.apply(changes), Error);
    EXPECT_EQ(grid.whole().blocks, before);
  };
  refused({8, 7, 0.1, {}});
  refused({8, 7, kResolution, {uniform(0, 0, 0, SpaceState::kFree), {{0, 0, 0}, {}}}});
  refused({8, 7, kResolution, {{{0, 0, 0}, {3}}}});
  refused({8, 0, kResolution, {{{0, 0, 0}, std::vector<std::uint8_t>(1023)}}});
  refused({8, 7, kResolution, {uniform(1 << 30, 0, 0, SpaceState::kFree)}});
  refused({8, 0, kResolution, {uniform(-1000000, -1000000, 0, SpaceState::kFree), uniform(1000000, 1000000, 0, SpaceState::kFree)}});
  for (const double resolution : {0.001, 2.0, std::nan("")}) EXPECT_THROW(StateGrid{resolution}, Error);
}

TEST(MapClient, FollowsMessagesAndSurfels) {
  std::mt19937 random(5);
  const StateChanges changes = random_changes(random, 4, 0);
  Message message = {changes.sequence, changes.since, changes.resolution, {}, {}, {}};
  for (const StateBlock& block : changes.blocks) {
    message.blocks.insert(message.blocks.end(), block.block.begin(), block.block.end());
    message.kinds.push_back(block.cells.size() == 1 ? block.cells[0] : Message::MIXED);
    if (block.cells.size() > 1) message.cells.insert(message.cells.end(), block.cells.begin(), block.cells.end());
  }
  MapClient client;
  StateGrid grid(kResolution);
  ASSERT_TRUE(client.apply(to_state_changes(message)));
  ASSERT_TRUE(grid.apply(changes));
  EXPECT_EQ(client.grid().whole().blocks, grid.whole().blocks);
  message.cells.pop_back();
  EXPECT_THROW(to_state_changes(message), Error);
  message.blocks.pop_back();
  EXPECT_THROW(to_state_changes(message), Error);

  Surfel surfel;
  surfel.id = 5;
  EXPECT_FALSE(client.apply(Changes{3, {surfel}, {}, 2}));
  EXPECT_TRUE(client.apply(Changes{3, {surfel}, {}, 0}));
  surfel.id = 6;
  surfel.position.x() = 2;
  EXPECT_TRUE(client.apply(Changes{4, {surfel}, {5}, 3}));
  EXPECT_TRUE(client.apply(Changes{3, {}, {6}, 2}));  // old
  EXPECT_EQ(client.surfels().size(), 1U);
  EXPECT_EQ(client.surfels({Eigen::Vector3f(1, -1, -1), Eigen::Vector3f(3, 1, 1)}).size(), 1U);
  EXPECT_EQ(client.surfels({Eigen::Vector3f(-1, -1, -1), Eigen::Vector3f(1, 1, 1)}).size(), 0U);
  EXPECT_TRUE(client.apply(StateChanges{5, 0, 0.1, {uniform(0, 0, 0, SpaceState::kFree)}}));  // the mapper has been restarted
  EXPECT_EQ(client.grid().resolution(), 0.1);
}

}  // namespace
}  // namespace frontier_surfels
