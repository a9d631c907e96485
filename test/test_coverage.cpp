/// Coverage against slow, obvious versions of its own definition.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "random_world.hpp"
#include "recordings/recorded_frame.hpp"
#include "synthetic/coverage.hpp"
#include "synthetic/simulated_camera.hpp"
#include "synthetic/synthetic_sensor.hpp"

using Eigen::Vector3d;
using namespace frontier_surfels;
using namespace frontier_surfels::replay;

namespace {

/// A room of 2 x 3 x 2 m with a pillar, and another one behind a closed wall, which no camera can reach.
World two_rooms() {
  return World({box({-0.1, -0.1, -0.1}, {4.1, 3.1, 0}, {}), box({-0.1, -0.1, 2}, {4.1, 3.1, 2.1}, {}),
                box({-0.1, -0.1, 0}, {0, 3.1, 2}, {}), box({2, 0, 0}, {2.1, 3, 2}, {}), box({4, -0.1, 0}, {4.1, 3.1, 2}, {}),
                box({0, -0.1, 0}, {4, 0, 2}, {}), box({0, 3, 0}, {4, 3.1, 2}, {}), cylinder({1.2, 1.4, 0}, 0.2, 1.5, {}),
                box({0, 2.5, 0.3}, {0.6, 3, 0.4}, {}), sphere({0.4, 0.5, 1.2}, 0.15, {})});
}

const Eigen::AlignedBox3d kBounds(Vector3d(0, 0, 0), Vector3d(4, 3, 2));
const Vector3d kStart(0.91, 0.72, 0.93);  // so that no distance is exactly that of a limit

CoverageOptions coarse() {
  CoverageOptions options;
  options.spacing = 0.11;
  options.lattice = 0.3;
  options.lowest = 0.35;
  options.highest = 1.8;
  options.z_max = 1.7;
  return options;
}

/// All positions of the lattice that have a way to the start, found by looking again and again.
std::vector<Vector3d> slow_positions(const World& world, const CoverageOptions& options) {
  std::vector<Vector3d> candidates, reached;
  for (int z = -20; z <= 20; ++z) {
    for (int y = -20; y <= 20; ++y) {
      for (int x = -20; x <= 20; ++x) {
        const Vector3d p = kStart + options.lattice * Vector3d(x, y, z);
        if (!kBounds.contains(p) || p.z() < options.lowest || p.z() > options.highest || world.distance(p) < options.clearance) continue;
        (x == 0 && y == 0 && z == 0 ? reached : candidates).push_back(p);
      }
    }
  }
  const auto has_way = [&](const Vector3d& a, const Vector3d& b) {
    if (std::abs((a - b).norm() - options.lattice) > 1e-6) return false;
    for (double share = 0; share <= 1; share += 1.0 / 64) {
      if (slow_distance(world.solids(), a + share * (b - a)) < options.clearance) return false;
    }
    return true;
  };
  for (std::size_t before = 0; before < reached.size();) {
    before = reached.size();
    for (auto p = candidates.begin(); p != candidates.end();) {
      const bool is_reached = std::any_of(reached.begin(), reached.end(), [&](const Vector3d& other) { return has_way(*p, other); });
      if (is_reached) reached.push_back(*p);
      p = is_reached ? candidates.erase(p) : p + 1;
    }
  }
  return reached;
}

std::vector<SurfacePoint> slow_points(const World& world, const std::vector<Vector3d>& positions, const CoverageOptions& options) {
  std::vector<SurfacePoint> points;
  for (const SurfacePoint& point : surface_points(world, options.spacing)) {
    const auto sees = [&](const Vector3d& camera) {
      const Vector3d to_camera = camera - point.position;
      const double angle = std::acos(to_camera.normalized().dot(point.normal)) * 180 / M_PI;
      if (to_camera.norm() < options.z_min || to_camera.norm() > options.z_max || angle >= options.max_incidence) return false;
      return slow_cast(world.solids(), camera, point.position + 1e-3 * point.normal - camera).second >= 1;
    };
    if (std::any_of(positions.begin(), positions.end(), sees)) points.push_back(point);
  }
  return points;
}

/// Whether an image sees a point, in the words of the definition.
bool slow_sees(const RecordedFrame& frame, const SurfacePoint& point, const CoverageOptions& options) {
  const Vector3d p = frame.T_world_camera.inverse() * point.position;
  if (p.z() < options.z_min || p.z() > options.z_max) return false;
  const Vector3d to_camera = (frame.T_world_camera.translation() - point.position).normalized();
  const double angle = std::acos(to_camera.dot(point.normal));
  if (angle * 180 / M_PI >= options.max_incidence) return false;
  const Intrinsics& camera = frame.intrinsics;
  const long u = std::lround(camera.fx * p.x() / p.z() + camera.cx), v = std::lround(camera.fy * p.y() / p.z() + camera.cy);
  if (u < 0 || v < 0 || u >= camera.width || v >= camera.height) return false;
  const int column = static_cast<int>(u), row = static_cast<int>(v);
  const double depth =
      frame.depth.type() == CV_32FC1 ? frame.depth.at<float>(row, column) : frame.depth.at<std::uint16_t>(row, column) * 0.001;
  if (!(depth >= options.z_min && depth <= options.z_max)) return false;
  return std::abs(depth - p.z()) <= options.depth_tolerance + 3 * options.noise_growth * p.z() * p.z() +
                                        0.71 * p.z() / std::min(camera.fx, camera.fy) / std::cos(angle);
}

RecordedFrame random_view(const World& world, const Vector3d& position, Random& random, bool noise) {
  SensorModel sensor;
  sensor.noise = noise;
  sensor.dropouts = noise ? 0.1 : 0;
  RecordedFrame frame;
  frame.intrinsics = camera_of_view(41, 31, kKinectView);
  frame.T_world_camera = Eigen::Isometry3d(Eigen::Translation3d(position));
  frame.T_world_camera.linear() =
      (Eigen::AngleAxisd(number(random, -M_PI, M_PI), Vector3d::UnitZ()) * Eigen::AngleAxisd(number(random, -1.2, 1.2), Vector3d::UnitY()))
          .toRotationMatrix() *
      T_body_optical().linear();
  const View view = world.render(frame.T_world_camera, frame.intrinsics);
  frame.depth = noise ? measure(view.depth, view.cos_incidence, sensor, static_cast<int>(random() % 1000)) : view.depth;
  return frame;
}

TEST(Coverage, KnowsWhatCanBeSeen) {
  const World world = two_rooms();
  const CoverageOptions options = coarse();
  const Coverage coverage(world, kBounds, kStart, options);
  auto positions = slow_positions(world, options);
  EXPECT_GT(positions.size(), 60U);
  ASSERT_EQ(coverage.positions().size(), positions.size());
  for (const Vector3d& p : coverage.positions()) {
    EXPECT_LT(p.x(), 2) << "the other room cannot be reached";
    EXPECT_TRUE(std::any_of(positions.begin(), positions.end(), [&](const Vector3d& q) { return (p - q).norm() < 1e-9; })) << p.transpose();
  }
  const auto points = slow_points(world, positions, options);
  const std::size_t all = surface_points(world, options.spacing).size();
  EXPECT_GT(points.size(), all / 4);
  EXPECT_LT(points.size(), all / 2) << "neither the outsides nor the other room count";
  ASSERT_EQ(coverage.points().size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) ASSERT_EQ(coverage.points()[i].position, points[i].position);
}

TEST(Coverage, CountsWhatImagesSee) {
  const World world = two_rooms();
  CoverageOptions options = coarse();
  Random random(5);
  for (const bool noise : {false, true}) {
    options.noise_growth = noise ? kKinectNoiseGrowth : 0;
    Coverage coverage(world, kBounds, kStart, options);
    std::vector<std::uint8_t> seen(coverage.points().size(), 0);
    std::size_t before = 0;
    for (int k = 0; k < 60; ++k) {
      const RecordedFrame frame = random_view(world, coverage.positions()[random() % coverage.positions().size()], random, noise);
      const std::size_t added = coverage.add(frame.view());
      for (std::size_t i = 0; i < seen.size(); ++i) seen[i] |= slow_sees(frame, coverage.points()[i], options);
      ASSERT_EQ(coverage.seen(), seen) << "view " << k;
      const auto count = static_cast<std::size_t>(std::count(seen.begin(), seen.end(), 1));
      ASSERT_EQ(coverage.seen_points(), count);
      ASSERT_EQ(added, count - before);
      before = count;
    }
    EXPECT_GT(coverage.share(), 0.6);
    EXPECT_NEAR(coverage.share(), static_cast<double>(before) / static_cast<double>(seen.size()), 1e-12);
    coverage.reset();
    EXPECT_EQ(coverage.share(), 0);
  }
}

/// With exact images, what is seen is what a ray from the camera meets, except beside edges.
TEST(Coverage, AgreesWithRays) {
  const World world = two_rooms();
  const CoverageOptions options = coarse();
  Coverage coverage(world, kBounds, kStart, options);
  Random random(6);
  std::size_t seen = 0, hidden = 0;
  for (int k = 0; k < 60; ++k) {
    RecordedFrame frame = random_view(world, coverage.positions()[random() % coverage.positions().size()], random, false);
    coverage.reset();
    coverage.add(frame.view());
    for (std::size_t i = 0; i < coverage.points().size(); ++i) {
      if (!coverage.seen()[i]) continue;
      ++seen;
      const SurfacePoint& point = coverage.points()[i];
      hidden += !world.sees(frame.T_world_camera.translation(), point.position + 1e-3 * point.normal);
    }
  }
  EXPECT_GT(seen, 5000U);
  EXPECT_LT(static_cast<double>(hidden), 0.01 * static_cast<double>(seen));
}

/// From every position to all sides: nearly everything that can be seen at all is seen.
TEST(Coverage, AllViewsTogetherSeeEverything) {
  const World world = two_rooms();
  Coverage coverage(world, kBounds, kStart, coarse());
  RecordedFrame frame;
  frame.intrinsics = camera_of_view(120, 120, 91);
  for (const Vector3d& position : coverage.positions()) {
    for (int side = 0; side < 6; ++side) {
      const Eigen::AngleAxisd turn = side < 4 ? Eigen::AngleAxisd(side * M_PI / 2, Vector3d::UnitZ())
                                              : Eigen::AngleAxisd(side == 4 ? M_PI / 2 : -M_PI / 2, Vector3d::UnitY());
      frame.T_world_camera = Eigen::Translation3d(position) * turn * T_body_optical();
      frame.depth = world.render(frame.T_world_camera, frame.intrinsics).depth;
      coverage.add(frame.view());
    }
  }
  EXPECT_GT(coverage.share(), 0.995);
}

TEST(Coverage, CountsWhatAMapHas) {
  const World world = two_rooms();
  CoverageOptions options = coarse();
  options.surfel_distance = 0.08;
  const Coverage coverage(world, kBounds, kStart, options);
  Random random(7);
  for (const int count : {0, 1, 300, 3000}) {
    std::vector<Surfel> surfels(static_cast<std::size_t>(count));
    for (Surfel& surfel : surfels) {
      surfel.label = random() % 4 == 0 ? Label::kFrontier : Label::kOccupied;
      surfel.position = point_in(random, {Vector3d(-0.3, -0.3, -0.3), Vector3d(2.3, 3.3, 2.3)}).cast<float>();
      if (random() % 50 == 0) surfel.position.x() = std::numeric_limits<float>::quiet_NaN();
      if (random() % 50 == 0) surfel.position.y() = 3e30F;
    }
    std::vector<std::uint8_t> expected;
    for (const SurfacePoint& point : coverage.points()) {
      expected.push_back(std::any_of(surfels.begin(), surfels.end(), [&](const Surfel& surfel) {
        return surfel.label == Label::kOccupied && (surfel.position.cast<double>() - point.position).norm() <= options.surfel_distance;
      }));
    }
    ASSERT_EQ(coverage.mapped(surfels), expected);
    EXPECT_NEAR(coverage.mapped_share(surfels),
                static_cast<double>(std::count(expected.begin(), expected.end(), 1)) / static_cast<double>(expected.size()), 1e-12);
    EXPECT_EQ(coverage.mapped_share(surfels) > 0.1, count == 3000);
  }
}

TEST(Coverage, IsTheSameOnAnyNumberOfThreads) {
  const World world = two_rooms();
  CoverageOptions options = coarse();
  options.threads = 1;
  const Coverage one(world, kBounds, kStart, options);
  options.threads = 3;
  const Coverage three(world, kBounds, kStart, options);
  ASSERT_EQ(one.points().size(), three.points().size());
  for (std::size_t i = 0; i < one.points().size(); ++i) ASSERT_EQ(one.points()[i].position, three.points()[i].position);
}

TEST(Coverage, RefusesWhatMakesNoSense) {
  const World world = two_rooms();
  const auto with = [&](double CoverageOptions::*field, double value) {
    CoverageOptions options = coarse();
    options.*field = value;
    return refused([&] { Coverage(world, kBounds, kStart, options); });
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(with(&CoverageOptions::spacing, 0.001), "spacing of the coverage is 0.001: it must be from 0.01 to 1 m.");
  EXPECT_NE(with(&CoverageOptions::lattice, kNan).find("lattice"), std::string::npos);
  EXPECT_NE(with(&CoverageOptions::lowest, kNan).find("lowest"), std::string::npos);
  EXPECT_NE(with(&CoverageOptions::highest, 0.1).find("highest"), std::string::npos);
  EXPECT_NE(with(&CoverageOptions::z_max, 0.2).find("z_max"), std::string::npos);
  EXPECT_NE(with(&CoverageOptions::max_incidence, 90).find("max_incidence"), std::string::npos);
  EXPECT_NE(with(&CoverageOptions::clearance, -1).find("clearance"), std::string::npos);
  EXPECT_NE(with(&CoverageOptions::lowest, 1.2).find("start"), std::string::npos) << "the start is lower";
  EXPECT_NE(refused([&] { Coverage(world, kBounds, {1.2, 1.4, 0.9}, coarse()); }).find("start"), std::string::npos) << "in the pillar";
  EXPECT_NE(refused([&] { Coverage(world, kBounds, {kNan, 1, 1}, coarse()); }).find("start"), std::string::npos);
  EXPECT_NE(refused([&] { Coverage(World({}), kBounds, kStart, coarse()); }).find("No surface"), std::string::npos);

  Coverage coverage(world, kBounds, kStart, coarse());
  EXPECT_FALSE(refused([&] { coverage.add(DepthFrame{}); }).empty());
  Random random(8);
  RecordedFrame frame = random_view(world, kStart, random, false);
  frame.intrinsics.width = 40;
  EXPECT_FALSE(refused([&] { coverage.add(frame.view()); }).empty());
  frame.intrinsics.width = 41;
  frame.T_world_camera.translation().x() = kNan;
  EXPECT_FALSE(refused([&] { coverage.add(frame.view()); }).empty());
  EXPECT_EQ(coverage.seen_points(), 0U);
}

}  // namespace
