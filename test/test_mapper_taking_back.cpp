/// Things that come where space was known to be free appear in the map, things that go leave it, and a world that stands still keeps what
/// is known of it.
#include <random>

#include "mapper_input.hpp"
#include "opencl/fault_injection.hpp"

namespace frontier_surfels {
namespace {

constexpr double kWall = 2, kFront = 1.5, kHalfSide = 0.25;  // [m]

/// A wall, and before it the front of a box, if it is there, by a camera that looks along z and moves along x.
/// @param noise  standard deviation of the depths [m]
replay::RecordedFrame wall_frame(int number, bool box, double noise = 0, double step = 0.008) {
  const double x = step * number;
  replay::RecordedFrame frame = plane_frame(working_camera(), kWall, Eigen::Isometry3d(Eigen::Translation3d(x, 0, 0)));
  const Intrinsics& camera = frame.intrinsics;
  std::mt19937 random(number);
  std::normal_distribution<double> error(0, noise > 0 ? noise : 1);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const double at_x = x + (u - camera.cx) / camera.fx * kFront, at_y = (v - camera.cy) / camera.fy * kFront;
      auto& depth = frame.depth.at<float>(v, u);
      if (box && std::abs(at_x) < kHalfSide && std::abs(at_y) < kHalfSide) depth = kFront;
      if (noise > 0) depth += static_cast<float>(error(random));
    }
  return frame;
}

/// Share of points on the box's front that have an occupied surfel within 2 cm.
double covered_share(const std::vector<Surfel>& surfels) {
  int points = 0, covered = 0;
  for (double x = -kHalfSide + 0.01; x < kHalfSide; x += 0.02)
    for (double y = -kHalfSide + 0.01; y < kHalfSide; y += 0.02, ++points)
      covered += std::any_of(surfels.begin(), surfels.end(), [&](const Surfel& surfel) {
        return surfel.label == Label::kOccupied && (surfel.position.cast<double>() - Eigen::Vector3d(x, y, kFront)).norm() < 0.02;
      });
  return static_cast<double>(covered) / points;
}

/// Surfels well before the wall, where the box's front is or was.
std::size_t surfels_at_box(const std::vector<Surfel>& surfels) {
  return static_cast<std::size_t>(std::count_if(surfels.begin(), surfels.end(), [](const Surfel& surfel) {
    return std::abs(surfel.position.z() - kFront) < 0.1 && surfel.position.head<2>().cwiseAbs().maxCoeff() < kHalfSide;
  }));
}

Config with_range(Config config = undecimated()) {
  config.z_max = 3;
  return config;
}

/// Frames first ... last - 1. @return pixels whose surface took space back
std::size_t add(Mapper& mapper, int first, int last, bool box, double step = 0.008) {
  std::size_t taken_back = 0;
  for (int n = first; n < last; ++n) taken_back += mapper.integrate(wall_frame(n, box, 0, step).view()).taken_back;
  return taken_back;
}

TEST(MapperTakingBack, ABoxThatIsPutDownAppears) {
  Mapper mapper(with_range());
  EXPECT_EQ(add(mapper, 0, 20, false), 0U);
  EXPECT_EQ(covered_share(mapper.surfels()), 0);
  EXPECT_GT(add(mapper, 20, 28, true), 500U);
  EXPECT_GT(covered_share(mapper.surfels()), 0.8);
  add(mapper, 28, 40, true);
  EXPECT_GT(covered_share(mapper.surfels()), 0.97);
}

TEST(MapperTakingBack, ItIsOnceThatSpaceIsTakenBack) {
  Mapper mapper(with_range());
  add(mapper, 0, 20, false);
  const std::size_t first = add(mapper, 20, 40, true), later = add(mapper, 40, 60, true);
  EXPECT_GT(first, 500U);
  EXPECT_LT(later, first / 50);
}

TEST(MapperTakingBack, WithoutItTheBoxDoesNotAppear) {
  for (const bool seen_points : {true, false}) {
    Config config = with_range();
    config.take_back = !seen_points;  // which is of no use without seen points
    config.seen_points = seen_points;
    Mapper mapper(config);
    add(mapper, 0, 20, false);
    EXPECT_EQ(add(mapper, 20, 40, true), 0U);
    EXPECT_LT(covered_share(mapper.surfels()), 0.2);
  }
}

TEST(MapperTakingBack, ChangesTellOfIt) {
  Mapper mapper(with_range());
  add(mapper, 0, 20, false);
  const std::uint64_t before = mapper.changes(0).sequence;
  add(mapper, 20, 40, true);
  EXPECT_GT(covered_share(mapper.changes(before).updated), 0.97);
}

/// A camera that stands still keeps no views: what it has seen is known by seen points alone.
TEST(MapperTakingBack, ABoxAppearsBeforeACameraThatStandsStill) {
  Mapper mapper(with_range());
  add(mapper, 0, 30, false, 0);
  EXPECT_GT(add(mapper, 30, 45, true, 0), 500U);
  EXPECT_GT(covered_share(mapper.surfels()), 0.95);
}

TEST(MapperTakingBack, ABoxAppearsWithFewKeptViewsOrNone) {
  for (const int views : {0, 3}) {
    Config config = with_range();
    config.recent_views = views;
    Mapper mapper(config);
    add(mapper, 0, 20, false);
    add(mapper, 20, 40, true);
    EXPECT_GT(covered_share(mapper.surfels()), 0.9) << views << " kept views";
  }
}

TEST(MapperTakingBack, ABoxThatIsTakenAwayIsGoneAndComesBack) {
  Mapper mapper(with_range());
  add(mapper, 0, 20, true);
  EXPECT_GT(covered_share(mapper.surfels()), 0.97);
  add(mapper, 20, 40, false);
  EXPECT_EQ(surfels_at_box(mapper.surfels()), 0U);
  add(mapper, 40, 60, true);
  EXPECT_GT(covered_share(mapper.surfels()), 0.95);
  add(mapper, 60, 80, false);
  EXPECT_EQ(surfels_at_box(mapper.surfels()), 0U);
}

/// What is hidden behind the box keeps its last known state, and so does the wall.
TEST(MapperTakingBack, TheWallBehindStays) {
  Mapper mapper(with_range());
  add(mapper, 0, 20, false);
  const auto at_wall = [&] {
    const std::vector<Surfel> surfels = mapper.surfels();
    return std::count_if(surfels.begin(), surfels.end(), [](const Surfel& s) {
      return std::abs(s.position.z() - kWall) < 0.03 && s.position.head<2>().cwiseAbs().maxCoeff() < 0.2F;
    });
  };
  const auto before = at_wall();
  EXPECT_GT(before, 100);
  add(mapper, 20, 40, true);
  EXPECT_EQ(at_wall(), before);
}

TEST(MapperTakingBack, NothingIsTakenBackFromANoisyWorldThatStandsStill) {
  Mapper mapper(with_range());
  std::size_t taken_back = 0;
  for (int n = 0; n < 60; ++n) taken_back += mapper.integrate(wall_frame(n, true, 0.0015 * kWall * kWall).view()).taken_back;
  EXPECT_EQ(taken_back, 0U);
}

TEST(MapperTakingBack, ForgetsEverythingWithTheMap) {
  Mapper mapper(with_range()), fresh(with_range());
  add(mapper, 0, 20, false);
  add(mapper, 20, 40, true);
  mapper.reset();
  EXPECT_EQ(add(mapper, 0, 30, true), 0U);
  add(fresh, 0, 30, true);
  EXPECT_EQ(mapper.size(), fresh.size());
}

/// Each time the host waits, a graphics processor runs dry: once for what is new, once for the end of the frame, as without taken points.
TEST(MapperTakingBack, FramesThatOnlyGiveBackDoNotWaitForIt) {
  Config config = with_range();
  config.lanes = 1;
  Mapper mapper(config);
  add(mapper, 0, 20, false);
  EXPECT_GT(add(mapper, 20, 40, true), 500U);
  for (int n = 40; n < 50; ++n) {
    FaultInjection::stop();
    EXPECT_EQ(add(mapper, n, n + 1, false), 0U);
    EXPECT_LE(FaultInjection::count(Call::kWait), 2U) << "frame " << n;
  }
  EXPECT_EQ(surfels_at_box(mapper.surfels()), 0U);
}

TEST(MapperTakingBack, TheMapDoesNotDependOnWidthAndThreads) {
  std::vector<std::vector<Surfel>> maps;
  for (const auto& [lanes, threads] : {std::pair(16, 1), std::pair(16, 2), std::pair(1, 2)}) {
    Config config = with_range();
    config.lanes = lanes;
    config.threads = threads;
    Mapper mapper(config);
    add(mapper, 0, 15, false);
    add(mapper, 15, 30, true);
    add(mapper, 30, 40, false);
    add(mapper, 40, 55, true);
    maps.push_back(mapper.surfels());
  }
  EXPECT_TRUE(same(maps[0], maps[1]));
  EXPECT_TRUE(same(maps[0], maps[2]));
}

}  // namespace
}  // namespace frontier_surfels
