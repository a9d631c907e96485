/// World: its tree of boxes says the same as a look at every solid.
#include <gtest/gtest.h>

#include <random>

#include "random_world.hpp"
#include "synthetic/surface_points.hpp"

using Eigen::Vector3d;
using namespace frontier_surfels::replay;

namespace {

const Eigen::AlignedBox3d kInside(Vector3d::Constant(-1), Vector3d::Constant(1));

/// Some of them along axes and in planes of the walls.
Vector3d random_direction(Random& random, int i) {
  Vector3d direction(number(random, -1, 1), number(random, -1, 1), number(random, -1, 1));
  if (i % 5 == 0) direction[i % 3] = 0;
  if (i % 7 == 0) direction = (i % 2 == 0 ? 1 : -1) * Vector3d::Unit(i % 3);
  return direction;
}

TEST(World, CastsLikeALookAtEverySolid) {
  Random random(1);
  for (const int count : {0, 1, 2, 3, 7, 40, 150}) {
    const World world(random_solids(random, count));
    for (int i = 0; i < 2000; ++i) {
      const Vector3d origin = point_in(random, kInside), direction = random_direction(random, i);
      if (world.inside_solid(origin)) continue;
      const auto [solid, t] = slow_cast(world.solids(), origin, direction);
      const auto hit = world.cast(origin, direction);
      ASSERT_EQ(hit.has_value(), solid >= 0);
      ASSERT_EQ(hit->distance, t);
      const Solid& met = world.solids()[static_cast<std::size_t>(solid)];
      const Vector3d p = origin + t * direction;
      ASSERT_EQ(hit->normal, normal_at(met, p));
      ASSERT_EQ(hit->rgb, shaded(met, p, hit->normal)) << "of two solids at one place the first counts";
    }
  }
}

TEST(World, KnowsDistancesInFreeSpaceAndInSolids) {
  Random random(2);
  for (const int count : {0, 1, 5, 150}) {
    const World world(random_solids(random, count));
    for (int i = 0; i < 3000; ++i) {
      const Vector3d p = point_in(random, {Vector3d::Constant(-2), Vector3d::Constant(2)});
      ASSERT_EQ(world.distance(p), slow_distance(world.solids(), p));
    }
  }
}

TEST(World, SeesWhatNothingHides) {
  Random random(3);
  const World world(random_solids(random, 30));
  int seen = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vector3d from = point_in(random, kInside), to = point_in(random, kInside);
    if (world.inside_solid(from) || world.inside_solid(to)) continue;
    const bool expected = slow_cast(world.solids(), from, to - from).second >= 1;
    ASSERT_EQ(world.sees(from, to), expected);
    seen += expected;
  }
  EXPECT_GT(seen, 500);
}

TEST(World, OfNothingIsEmpty) {
  const World world({});
  EXPECT_FALSE(world.cast({0, 0, 0}, {1, 0, 0}));
  EXPECT_EQ(world.distance({0, 0, 0}), kNever);
  EXPECT_TRUE(world.sees({0, 0, 0}, {9, 0, 0}));
  EXPECT_EQ(world.free_length({0, 0, 0}, {3, 0, 4}, 0.2), 5);
  EXPECT_TRUE(surface_points(world, 0.1).empty());
}

/// Where a ball stops, against small steps.
TEST(World, KnowsHowFarABallCanGo) {
  Random random(4);
  const World world(random_solids(random, 12));
  constexpr double kRadius = 0.1, kStep = 1e-4;
  int stopped = 0;
  for (int i = 0; i < 300; ++i) {
    const Vector3d from = point_in(random, kInside), to = point_in(random, kInside);
    const double length = (to - from).norm(), free = world.free_length(from, to, kRadius);
    double expected = 0;
    if (world.distance(from) >= kRadius) {
      while (expected < length && world.distance(from + std::min(length, expected + kStep) / length * (to - from)) >= kRadius)
        expected += kStep;
      expected = std::min(expected, length);
    }
    ASSERT_NEAR(free, expected, 3e-3);
    stopped += expected > 0 && expected < length;
  }
  EXPECT_GT(stopped, 50);
}

TEST(World, BallsTouchButDoNotEnter) {
  const World world({box({1, -1, -1}, {2, 1, 1}, {})});
  EXPECT_NEAR(world.free_length({0, 0, 0}, {3, 0, 0}, 0.25), 0.75, 1e-3);
  EXPECT_EQ(world.free_length({0, 0, 0}, {0.7, 0, 0}, 0.25), 0.7);
  EXPECT_EQ(world.free_length({0.9, 0, 0}, {-1, 0, 0}, 0.25), 0) << "too close where it is";
  EXPECT_EQ(world.free_length({0.5, 0.5, 0}, {0.5, 0.5, 0}, 0.25), 0);
  EXPECT_EQ(world.free_length({0.75, 0, 0}, {0.75, 0.5, 0}, 0.25), 0.5) << "along a wall that it touches";
}

/// The points stand for areas: their number is that of the surface that is not covered, and they lie on it.
TEST(SurfacePoints, AreSpreadEvenly) {
  const World world(
      {box({0, 0, 0}, {1, 2, 3}, {}), box({0.2, 0.2, 3}, {0.7, 0.6, 4}, {}), cylinder({5, 0, 0}, 0.5, 2, {}), sphere({0, 9, 0}, 1, {})});
  constexpr double kSpacing = 0.05;
  const auto points = surface_points(world, kSpacing);
  const double boxes = 22 + 2.2 - 2 * 0.2;  // where they touch, both are covered
  const double area = boxes + (2 * M_PI * 0.5 * 2 + 2 * M_PI * 0.25) + 4 * M_PI;
  EXPECT_NEAR(static_cast<double>(points.size()) * kSpacing * kSpacing, area, 0.02 * area);
  for (const SurfacePoint& point : points) {
    ASSERT_NEAR(point.normal.norm(), 1, 1e-12);
    ASSERT_NEAR(world.distance(point.position), 0, 1e-9);
    ASSERT_GT(world.distance(point.position + 1e-3 * point.normal), 0) << "the lower box's top is covered where the upper one stands";
    ASSERT_LT(world.distance(point.position - 1e-3 * point.normal), 0);
  }
}

}  // namespace
