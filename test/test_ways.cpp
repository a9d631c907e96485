// Ways through a grid of states against slow, obvious ones.
#include <gtest/gtest.h>

#include <set>

#include "ways_input.hpp"

namespace frontier_surfels {
namespace {

constexpr Index kLow = {-30, -18, -5}, kSize = {60, 44, 22};  // [cells] 3 x 2.2 x 1.1 m, some of them at negative coordinates

float length_of(const std::vector<Eigen::Vector3f>& way) {
  float length = 0;
  for (std::size_t n = 1; n < way.size(); ++n) length += (way[n] - way[n - 1]).norm();
  return length;
}
Index place_near(const Eigen::Vector3d& p, double lattice) {
  return {static_cast<int>(std::lround(p.x() / lattice)), static_cast<int>(std::lround(p.y() / lattice)),
          static_cast<int>(std::lround(p.z() / lattice))};
}

CellBox free_box() {
  CellBox box(kLow, kSize);
  box.fill(SpaceState::kFree);
  return box;
}

/// Free space with boxes in it, occupied and unknown.
CellBox random_box(std::mt19937& random, int count) {
  CellBox box = free_box();
  for (int n = 0; n < count; ++n) {
    Index low, high;
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = kLow[axis] + static_cast<int>(random() % kSize[axis]);
      high[axis] = low[axis] + 1 + static_cast<int>(random() % (axis == 2 ? 20 : 5));
    }
    box.fill(low, high, random() % 2 != 0 ? SpaceState::kOccupied : SpaceState::kUnknown);
  }
  return box;
}

/// A wall of one cell across the box at x = 0, with an opening.
CellBox walled_box(const Index& low, const Index& high) {
  CellBox box = free_box();
  box.fill({0, -100, -100}, {1, 100, 100}, SpaceState::kOccupied);
  box.fill(low, high, SpaceState::kFree);
  return box;
}

/// All places of the lattice in and around the box.
std::pair<Index, Index> places_of_box(double lattice, double around = 1) {
  Index low, high;
  for (int axis = 0; axis < 3; ++axis) {
    low[axis] = static_cast<int>(std::floor((kLow[axis] * kCell - around) / lattice));
    high[axis] = static_cast<int>(std::ceil(((kLow[axis] + kSize[axis]) * kCell + around) / lattice));
  }
  return {low, high};
}

/// Radii are no multiples of half a cell: whether a ball touches the cell that it touches in one point is a matter of rounding.
WayOptions options_of(double lattice, double radius) {
  WayOptions options;
  options.lattice = lattice;
  options.radius = radius;
  return options;
}

void expect_same_lengths(const Ways& ways, const SlowWays& slow, const std::pair<Index, Index>& extent, const Index& from) {
  std::size_t reached = 0;
  std::set<Index> expected;
  for (int x = extent.first[0]; x <= extent.second[0]; ++x)
    for (int y = extent.first[1]; y <= extent.second[1]; ++y)
      for (int z = extent.first[2]; z <= extent.second[2]; ++z) {
        const Index place = {x, y, z};
        const double length = slow.length(place);
        if (length == kNoWay) {
          ASSERT_EQ(ways.length(slow.at(place)), kNoWay) << slow.at(place).transpose();
          ASSERT_TRUE(ways.way(slow.at(place)).empty()) << slow.at(place).transpose();
          continue;
        }
        ++reached;
        ASSERT_NEAR(ways.length(slow.at(place)), length, 1e-4) << slow.at(place).transpose();
        if (place != from) expected.insert(place);
      }
  ASSERT_GT(reached, 0U);
}

void expect_same_places(const Ways& ways, const SlowWays& slow, const Index& from, double lattice) {
  std::set<Index> found, expected;
  for (const Eigen::Vector3f& p : ways.places()) {
    const Index place = place_near(p.cast<double>(), lattice);
    ASSERT_LT((p - slow.at(place)).norm(), 1e-5) << p.transpose();
    ASSERT_TRUE(found.insert(place).second) << "told twice: " << p.transpose();
  }
  for (const auto& [place, length] : slow.lengths())
    if (length < kNoWay) expected.insert(place);
  found.insert(from);  // whether the start is told if it is closed is not said
  ASSERT_EQ(found, expected);
}

/// What every way must be: from here to there, no longer than its length says, and free at least as far as the balls at the places are.
void expect_open(const Ways& ways, const SlowWays& slow, const Eigen::Vector3f& from, const Eigen::Vector3f& to,
                 const WayOptions& options) {
  const std::vector<Eigen::Vector3f> way = ways.way(to);
  ASSERT_GE(way.size(), 2U);
  ASSERT_EQ(way.front(), from);
  ASSERT_EQ(way.back(), to);
  ASSERT_LE(length_of(way), ways.length(to) + 1e-4);
  ASSERT_GE(ways.length(to), (to - from).norm() - 1e-4);
  const double between = std::sqrt(std::max(0.0, options.radius * options.radius - 0.75 * options.lattice * options.lattice));
  for (std::size_t n = 1; n < way.size(); ++n) {
    const Eigen::Vector3d a = way[n - 1].cast<double>(), b = way[n].cast<double>();
    ASSERT_TRUE(n == 1 || slow.is_open(a)) << "corner " << a.transpose();
    const int steps = static_cast<int>((b - a).norm() / 0.02) + 1;
    for (int s = 0; s <= steps; ++s)
      ASSERT_TRUE(slow.is_free(a + (b - a) * s / steps, between - 1e-4)) << a.transpose() << " -> " << b.transpose();
  }
}

TEST(Ways, LengthsAndPlacesAreTheSlowOnes) {
  std::mt19937 random(11);
  int walled = 0;
  for (int run = 0; run < 30; ++run) {
    const double lattice = std::array<double, 4>{0.2, 0.13, 0.1, 0.25}[run % 4],
                 radius = std::array<double, 3>{0.113, 0.162, 0.034}[run % 3];
    const CellBox box = random_box(random, run < 3 ? run : 10 + static_cast<int>(random() % 60));
    const WayOptions options = options_of(lattice, radius);
    const auto extent = places_of_box(lattice, 0.3);
    Index from = place_near({-1 + 0.1 * (run % 9), 0.1 * (run % 5), 0.3}, lattice);
    const SlowWays all(box, from, options, extent.first, extent.second);
    while (!all.is_open(all.at(from).cast<double>())) ++from[0];
    const SlowWays slow(box, from, options, extent.first, extent.second);
    const StateGrid grid = box.grid();
    const Ways ways(grid, slow.at(from), options);
    expect_same_lengths(ways, slow, extent, from);
    expect_same_places(ways, slow, from, lattice);
    for (const auto& [place, length] : slow.lengths()) walled += length == kNoWay;
    if (HasFatalFailure()) FAIL() << "run " << run;
  }
  EXPECT_GT(walled, 20) << "no run had open places that cannot be reached: the test would not see it";
}

TEST(Ways, AreOpenAllAlong) {
  std::mt19937 random(12);
  int bent = 0, straight = 0;
  for (int run = 0; run < 4; ++run) {
    const CellBox box = random_box(random, 40);
    const WayOptions options = options_of(0.1, 0.122);
    const auto extent = places_of_box(options.lattice, 0.3);
    Index from = {-5, 0, 3};
    const SlowWays all(box, from, options, extent.first, extent.second);
    while (!all.is_open(all.at(from).cast<double>())) ++from[0];
    const SlowWays slow(box, from, options, extent.first, extent.second);
    const StateGrid grid = box.grid();
    const Ways ways(grid, slow.at(from), options);
    for (const auto& [place, length] : slow.lengths()) {
      if (length == kNoWay || length == 0 || random() % 4 != 0) continue;
      expect_open(ways, slow, slow.at(from), slow.at(place), options);
      if (HasFatalFailure()) FAIL() << "run " << run;
      (ways.way(slow.at(place)).size() > 2 ? bent : straight) += 1;
    }
  }
  EXPECT_GT(bent, 200);
  EXPECT_GT(straight, 200);
}

TEST(Ways, OffTheLatticeAreAsLongAsTheirSteps) {
  std::mt19937 random(13);
  const CellBox box = random_box(random, 30);
  const WayOptions options = options_of(0.15, 0.12);
  const auto extent = places_of_box(options.lattice, 0.3);
  const StateGrid grid = box.grid();
  std::uniform_real_distribution<float> x(-1.3F, 1.3F), y(-0.7F, 1.1F), z(-0.1F, 0.7F);
  int found = 0;
  for (int n = 0; n < 40; ++n) {
    const float a = x(random), b = y(random), c = z(random);
    const Eigen::Vector3f from(a, b, c);
    const Index place = place_near(from.cast<double>(), options.lattice);
    const SlowWays slow(box, place, options, extent.first, extent.second);
    if (!slow.is_open(from.cast<double>()) || !slow.is_open(slow.at(place).cast<double>())) continue;
    const Ways ways(grid, from, options);
    for (int m = 0; m < 50; ++m) {
      const float d = x(random), e = y(random), f = z(random);
      const Eigen::Vector3f to(d, e, f);
      const Index last = place_near(to.cast<double>(), options.lattice);
      if (!slow.is_open(to.cast<double>())) {
        ASSERT_EQ(ways.length(to), kNoWay) << "the robot does not fit in there: " << to.transpose();
        continue;
      }
      if (!slow.is_open(slow.at(last).cast<double>())) continue;
      const double length = slow.length(last);
      ASSERT_EQ(ways.length(to) == kNoWay, length == kNoWay) << to.transpose();
      if (length == kNoWay) continue;
      ++found;
      ASSERT_NEAR(ways.length(to), length, 2 * std::sqrt(3.0) * options.lattice) << from.transpose() << " -> " << to.transpose();
      expect_open(ways, slow, from, to, options);
      if (HasFatalFailure()) return;
    }
  }
  EXPECT_GT(found, 100);
}

TEST(Ways, FreeSpaceNeedsNoCorners) {
  const CellBox box = free_box();
  const StateGrid grid = box.grid();
  const Ways ways(grid, {-1, 0, 0.4F}, options_of(0.2, 0.11));
  const std::vector<Eigen::Vector3f> way = ways.way({1, 0.6F, 0.2F});
  ASSERT_EQ(way.size(), 2U);
  EXPECT_EQ(way[0], Eigen::Vector3f(-1, 0, 0.4F));
  EXPECT_EQ(way[1], Eigen::Vector3f(1, 0.6F, 0.2F));
  EXPECT_NEAR(ways.length({1, 0, 0.4F}), 2, 1e-5);
  EXPECT_EQ(ways.length({-1, 0, 0.4F}), 0);
}

TEST(Ways, LeadThroughADoorThatIsWideEnough) {
  const Eigen::Vector3f from(-1, 0.8F, 0.4F), to(1, 0.8F, 0.4F);
  const StateGrid wide = walled_box({0, -9, -100}, {1, -1, 100}).grid();  // y from -0.45 to -0.05 m
  const StateGrid narrow = walled_box({0, -7, -100}, {1, -3, 100}).grid();
  const StateGrid closed = walled_box({0, 0, 0}, {0, 0, 0}).grid();
  const WayOptions options = options_of(0.1, 0.122);
  const Ways through(wide, from, options);
  EXPECT_GT(through.length(to), 2.2F);
  const std::vector<Eigen::Vector3f> way = through.way(to);
  ASSERT_GE(way.size(), 3U);
  float lowest = 1;
  for (const Eigen::Vector3f& p : way) lowest = std::min(lowest, p.y());
  EXPECT_LT(lowest, -0.05F);
  for (const StateGrid* grid : {&narrow, &closed}) {
    const Ways none(*grid, from, options);
    EXPECT_EQ(none.length(to), kNoWay);
    EXPECT_TRUE(none.way(to).empty());
    EXPECT_LT(none.length({-1, -0.4F, 0.4F}), 2);
    for (const Eigen::Vector3f& p : none.places()) EXPECT_LT(p.x(), 0) << p.transpose();
  }
}

/// A wall is a wall, whether or not a place of the lattice is in it.
TEST(Ways, DoNotStepOverThinWalls) {
  const StateGrid closed = walled_box({0, 0, 0}, {0, 0, 0}).grid();
  for (const double lattice : {0.2, 0.35, 0.5, 0.7}) {
    const Ways ways(closed, {-1.05F, 0, 0.35F}, options_of(lattice, 0.03));
    EXPECT_EQ(ways.length({1.05F, 0, 0.35F}), kNoWay) << lattice;
  }
}

TEST(Ways, KeepToTheirHeights) {
  const StateGrid window = walled_box({0, -100, 8}, {1, 100, 100}).grid();  // z from 0.4 m
  const Eigen::Vector3f from(-0.5F, 0, 0.2F), to(0.5F, 0, 0.2F);
  WayOptions options = options_of(0.1, 0.122);
  EXPECT_GT(Ways(window, from, options).length(to), 1.1F);
  options.lowest = 0.15;
  options.highest = 0.45;
  const Ways low(window, from, options);
  EXPECT_EQ(low.length(to), kNoWay);
  EXPECT_EQ(low.length({-0.5F, 0, 0.6F}), kNoWay);
  EXPECT_EQ(low.length({-0.5F, 0, 0.46F}), kNoWay) << "a place of the lattice is near, but the point is too high";
  EXPECT_FALSE(low.places().empty());
  for (const Eigen::Vector3f& p : low.places()) EXPECT_TRUE(p.z() > 0.15F && p.z() < 0.45F) << p.transpose();
  options.lowest = options.highest = 0.2F;  // one layer
  const Ways flat(window, from, options);
  EXPECT_NEAR(flat.length({-1, 0, 0.2F}), 0.5F, 1e-5);
  for (const Eigen::Vector3f& p : flat.places()) EXPECT_FLOAT_EQ(p.z(), 0.2F);
  for (const double height : {-1e300, -5.0, 0.25, 5.0, 1e300}) {  // no place of the lattice is there
    options.lowest = options.highest = height;
    EXPECT_TRUE(Ways(window, from, options).places().empty()) << height;
  }
}

TEST(Ways, LeaveAClosedPlace) {
  CellBox box = free_box();
  box.fill({-1, -1, 7}, {1, 1, 9}, SpaceState::kOccupied);  // around (0, 0, 0.4)
  const StateGrid grid = box.grid();
  const WayOptions options = options_of(0.2, 0.11);
  const auto extent = places_of_box(options.lattice, 0.3);
  const SlowWays slow(box, {0, 0, 2}, options, extent.first, extent.second);
  const Ways ways(grid, {0, 0, 0.4F}, options);
  expect_same_lengths(ways, slow, extent, {0, 0, 2});
  expect_same_places(ways, slow, {0, 0, 2}, options.lattice);
  const std::vector<Eigen::Vector3f> way = ways.way({1, 0, 0.4F});
  ASSERT_FALSE(way.empty());
  EXPECT_EQ(way.front(), Eigen::Vector3f(0, 0, 0.4F));
  EXPECT_EQ(Ways(grid, {1, 0, 0.4F}, options).length({0, 0, 0.4F}), kNoWay) << "another robot cannot go there";
}

TEST(Ways, WalledInRobotsStayWhereTheyAre) {
  CellBox box = free_box();
  box.fill({-8, -8, -100}, {8, 8, 100}, SpaceState::kOccupied);
  const StateGrid grid = box.grid();
  const Ways ways(grid, {0, 0, 0.4F}, options_of(0.1, 0.11));
  EXPECT_EQ(ways.length({1, 0, 0.4F}), kNoWay);
  EXPECT_LE(ways.places().size(), 1U);
}

TEST(Ways, EmptyGrid) {
  const StateGrid grid(kCell);
  const Ways ways(grid, {0, 0, 0}, {});
  EXPECT_EQ(ways.length({0.4F, 0, 0}), kNoWay);
  EXPECT_TRUE(ways.way({0.4F, 0, 0}).empty());
  EXPECT_LE(ways.places().size(), 1U);
}

/// Also where the grid ends, or is empty.
TEST(Ways, UnknownMayBeWhereTheRobotHasBeen) {
  std::mt19937 random(14);
  int more = 0;
  for (int run = 0; run < 12; ++run) {
    const CellBox box = run == 0 ? CellBox(kLow, kSize) : random_box(random, 60);
    WayOptions options = options_of(run % 2 != 0 ? 0.1 : 0.13, 0.113);
    options.own_room = 0.357 + 0.05 * (run % 4);
    if (run > 1) options.been.emplace_back(-1.2F + 0.1F * static_cast<float>(run), 0.3F, 0.5F);
    const Index from = place_near({-1.4, 0.9, 1.1}, options.lattice);  // near a corner of the box: its room reaches out of it
    const auto extent = places_of_box(options.lattice);
    const SlowWays without(box, from, options_of(options.lattice, options.radius), extent.first, extent.second);
    options.been.push_back(without.at(from));
    const SlowWays slow(box, from, options, extent.first, extent.second);
    if (!slow.is_open(slow.at(from).cast<double>())) continue;
    const StateGrid grid = box.grid();
    const Ways ways(grid, slow.at(from), options);
    expect_same_lengths(ways, slow, extent, from);
    expect_same_places(ways, slow, from, options.lattice);
    if (HasFatalFailure()) FAIL() << "run " << run;
    for (const auto& [place, length] : slow.lengths()) more += length < kNoWay && without.length(place) == kNoWay;
  }
  EXPECT_GT(more, 200);
}

/// A corridor as wide as the ball is wide enough, wherever its middle is rounded to.
TEST(Ways, TouchingIsNoCollision) {
  const WayOptions options = options_of(0.2, 0.25);
  for (int y = 2; y < 60; ++y) {
    CellBox box({0, 4 * y - 8, 0}, {40, 16, 16});
    box.fill(SpaceState::kOccupied);
    box.fill({0, 4 * y - 5, 0}, {40, 4 * y + 5, 16}, SpaceState::kFree);
    const StateGrid grid = box.grid();
    const Eigen::Vector3f from = SlowWays(box, {2, y, 2}, options, {2, y, 2}, {2, y, 2}).at({2, y, 2});
    EXPECT_NEAR(Ways(grid, from, options).length(from + Eigen::Vector3f(1.2F, 0, 0)), 1.2F, 1e-5) << from.transpose();
    EXPECT_EQ(Ways(grid, from, options_of(0.2, 0.252)).length(from + Eigen::Vector3f(1.2F, 0, 0)), kNoWay) << from.transpose();
  }
}

TEST(Ways, AreTheSameEachTime) {
  std::mt19937 random(16);
  const StateChanges changes = random_box(random, 40).changes();
  StateChanges turned = changes;
  std::reverse(turned.blocks.begin(), turned.blocks.end());
  StateGrid grid(kCell), other(kCell);
  ASSERT_TRUE(grid.apply(changes));
  for (const StateBlock& block : turned.blocks) ASSERT_TRUE(other.apply({other.sequence() + 1, other.sequence(), kCell, {block}}));
  const Eigen::Vector3f from(-1.04F, 0.03F, 0.41F);
  const Ways ways(grid, from, options_of(0.1, 0.11)), same(other, from, options_of(0.1, 0.11));
  ASSERT_EQ(ways.places(), same.places());
  ASSERT_GT(ways.places().size(), 100U);
  for (const Eigen::Vector3f& p : ways.places()) {
    ASSERT_EQ(ways.length(p), same.length(p));
    ASSERT_EQ(ways.way(p), same.way(p));
    ASSERT_EQ(ways.way(p), ways.way(p));
  }
}

TEST(Ways, NoPlacesAreNotReached) {
  const StateGrid grid = free_box().grid();
  const Ways ways(grid, {0, 0, 0.4F}, options_of(0.2, 0.11));
  const float nan = std::nanf(""), inf = kNoWay;
  for (const float bad : {nan, inf, -inf, 1e30F, -1e30F, 1e9F, 5e8F})
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector3f to(0, 0, 0.4F);
      to[axis] = bad;
      EXPECT_EQ(ways.length(to), kNoWay) << bad;
      EXPECT_TRUE(ways.way(to).empty()) << bad;
    }
  for (const float far : {1e30F, -1e9F, 1e5F}) {
    const Ways lost(grid, {far, 0, 0}, options_of(0.2, 0.11));
    EXPECT_EQ(lost.length({0, 0, 0.4F}), kNoWay);
    EXPECT_LE(lost.places().size(), 1U);
  }
}

}  // namespace
}  // namespace frontier_surfels
