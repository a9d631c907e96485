/// The exact test on a scene whose answers are computed by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <thread>

#include "exact_test_input.hpp"
#include "frontier_surfels/scoring/exact_test.hpp"

namespace frontier_surfels::scoring {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

// One camera of 160 x 120 pixels at the origin. It measures a wall at 1 m where x < 0, and a wall at 1.5 m where x > 0. Known space ends at
// the walls, at the step between them (x = 0, z from 1 to 1.5 m) and at the sides of the image.

constexpr double kLeft = 1.0, kRight = 1.5;         // [m]
constexpr double kSide = 0.8, kTop = 0.6;           // x / z and y / z of the image's sides
const Vector3d kSideInward(1, 0, kSide);            // normal of the left side, not of unit length
const Vector3d kTowards(0, 0, -1), kAway(0, 0, 1);  // towards the camera, away from it

ExactTest step_scene() {
  OwnedFrame frame({100, 100, 79.5, 59.5, 160, 120}, Eigen::Isometry3d::Identity(), Encoding::kStepsU16, 6, false);
  for (int t = 0; t < 120; ++t) {
    for (int s = 0; s < 160; ++s) frame.set(s, t, s < 80 ? kLeft : kRight);
  }
  ExactTest test(reading(0.5, 3, 1));
  test.add(frame.view());
  return test;
}

struct KnownSurfel {
  const char* what;
  Surfel surfel;  // with a radius of 10 mm, hence a voxel of 11.5 mm
  Verdict verdict;
  double distance;  // to the nearest step from unknown to known along the normal [m]
};

std::vector<KnownSurfel> known_surfels() {
  const auto at_wall = [](double z, const Vector3d& normal) { return make_surfel({-0.3, 0.1, z}, normal); };
  return {
      {"on the wall", at_wall(1.0, kTowards), Verdict::kRight, 0.001},
      {"on the farther wall", make_surfel({0.3, 0.1, 1.5005}, kTowards), Verdict::kRight, 0.001},
      {"on the step", make_surfel({-0.0005, 0.1, 1.25}, {1, 0, 0}), Verdict::kRight, 0.001},
      {"on the image's side", make_surfel(Vector3d(-kSide, 0.1, 1) * 0.8 - 0.0005 * kSideInward, kSideInward), Verdict::kRight, 0.001},
      {"11 mm behind", at_wall(1.0105, kTowards), Verdict::kRight, 0.011},
      {"13 mm behind", at_wall(1.0125, kTowards), Verdict::kRight, 0.013},
      {"19 mm behind", at_wall(1.0185, kTowards), Verdict::kFloating, 0.019},
      {"21 mm behind", at_wall(1.0205, kTowards), Verdict::kFloating, 0.021},
      {"23 mm behind", at_wall(1.0225, kTowards), Verdict::kFloating, 0.023},
      {"25 mm behind", at_wall(1.0245, kTowards), Verdict::kFloating, 0.025},
      {"49 mm behind", at_wall(1.0485, kTowards), Verdict::kFloating, 0.049},
      {"51 mm behind", at_wall(1.0505, kTowards), Verdict::kFloating, kInf},
      {"just in front", at_wall(0.9985, kTowards), Verdict::kRight, 0.001},
      {"3 mm in front", at_wall(0.9965, kTowards), Verdict::kBuried, 0.003},
      {"29 mm in front", at_wall(0.9705, kTowards), Verdict::kBuried, 0.029},
      {"in the open", at_wall(0.8, kTowards), Verdict::kBuried, kInf},
      {"on the wall, turned", at_wall(0.9995, kAway), Verdict::kFlipped, kInf},
      {"behind the camera", make_surfel({0, 0, -1}, kTowards), Verdict::kFloating, kInf},
      {"not a number", make_surfel({kNan, 0, 1}, kTowards), Verdict::kFloating, kInf},
      {"infinite", make_surfel({0, kInf, 1}, kTowards), Verdict::kFloating, kInf},
      {"without a radius", make_surfel({0, 0, 0.8}, kTowards, kNan), Verdict::kFloating, kInf},
      {"far outside", make_surfel({1e30, 1e30, -1e30}, kTowards), Verdict::kFloating, kInf},
  };
}

TEST(ExactTest, KnowsWhatIsBetweenCameraAndSurface) {
  const ExactTest test = step_scene();
  EXPECT_TRUE(test.known({-0.1, 0, 0.999}));
  EXPECT_FALSE(test.known({-0.1, 0, 1.0}));  // on the surface
  EXPECT_TRUE(test.known({0.1, 0, 1.499}));
  EXPECT_FALSE(test.known({0.1, 0, 1.501}));
  EXPECT_TRUE(test.known({0, 0, 1.2}));  // pixel 79.5 rounds up: the right half
  EXPECT_FALSE(test.known({-1e-6, 0, 1.2}));
  EXPECT_TRUE(test.known({-0.7999, 0, 0.9999}));  // half a pixel around the outermost centres
  EXPECT_FALSE(test.known({-0.8001, 0, 0.9999}));
  EXPECT_FALSE(test.known({0.8, 0, 1}));  // pixel 159.5 rounds up: outside
  EXPECT_TRUE(test.known({0.1, -0.5999, 0.9999}));
  EXPECT_FALSE(test.known({0.1, 0.6, 1}));
  EXPECT_TRUE(test.known({0, 0, 1e-9}));
  EXPECT_FALSE(test.known({0, 0, 0}));
  EXPECT_FALSE(test.known({0, 0, -1}));
  EXPECT_FALSE(test.known({kNan, 0, 1}));
  EXPECT_FALSE(test.known({0, 0, kInf}));
}

TEST(ExactTest, DepthsOutsideTheRangeAreNoMeasurements) {
  const std::vector<std::pair<double, bool>> cases = {{0.4999, false}, {0.7, true},   {1.3, true},   {1.3001, false},
                                                      {0, false},      {kNan, false}, {kInf, false}, {-1, false}};
  for (const auto& [depth, valid] : cases) {
    OwnedFrame frame({10, 10, 2, 2, 5, 5}, Eigen::Isometry3d::Identity(), Encoding::kMetresF32, 0, false);
    for (int t = 0; t < 5; ++t) {
      for (int s = 0; s < 5; ++s) frame.set(s, t, depth);
    }
    ExactTest test(reading(depth == 0.7 ? 0.7 : 0.5, 1.3, 1));  // 0.7 is not a float: the limit itself must still be valid
    test.add(frame.view());
    EXPECT_EQ(test.known({0, 0, 0.3}), valid) << depth;
  }
}

/// A depth beyond the range, or none at all: known up to z_max if the configuration carves it, and never a surface.
TEST(ExactTest, CarvesWhatTheConfigurationSays) {
  for (const double depth : {1.8, kInf}) {
    for (const bool carved : {false, true}) {
      OwnedFrame frame({20, 20, 9.5, 9.5, 20, 20}, Eigen::Isometry3d::Identity(), Encoding::kMetresF32, 0, false);
      for (int i = 0; i < 400; ++i) frame.set(i % 20, i / 20, depth);
      Config config = reading(0.5, 1.3, 1);
      config.carve_no_return = carved == std::isinf(depth);
      config.carve_beyond_range = carved != std::isinf(depth);
      ExactTest test(config);
      test.add(frame.view());
      SCOPED_TRACE(std::to_string(depth) + (carved ? ", carved" : ""));
      EXPECT_EQ(test.known({0, 0, 1.299}), carved);
      EXPECT_FALSE(test.known({0, 0, 1.301}));
      const std::vector<BoundaryPoint> boundary = test.boundary(1000, ExactTest::kSeed);
      EXPECT_EQ(boundary.size() > 100, carved);
      for (const BoundaryPoint& point : boundary) EXPECT_FALSE(point.occupied);
      const ExactScore score = test.score({make_surfel({0, 0, 1.3}, kTowards)}, 100);
      EXPECT_EQ(score.right, carved ? 1 : 0);
    }
  }
}

TEST(ExactTest, DecimatesLikeTheMapper) {
  OwnedFrame frame({100, 80, 3, 5, 11, 14}, Eigen::Isometry3d::Identity(), Encoding::kStepsU16, 3, true);
  for (int t = 0; t < 14; t += 4) {
    for (int s = 0; s < 11; s += 4) frame.set(s, t, 1 + 0.1 * (s / 4) + 0.01 * (t / 4));
  }
  ExactTest test(nearest_reading(0.5, 3, 4));  // 2 x 3 pixels: column 8 and row 12 begin no whole block
  test.add(frame.view());
  for (int t = 0; t < 4; ++t) {
    for (int s = 0; s < 3; ++s) {
      const double depth = 1 + 0.1 * s + 0.01 * t;
      const Vector3d ray((s - 0.75) / 25, (t - 1.25) / 20, 1);
      EXPECT_EQ(test.known(ray * (depth - 0.001)), s < 2 && t < 3) << s << " " << t;
      EXPECT_FALSE(test.known(ray * (depth + 0.001))) << s << " " << t;
    }
  }
}

TEST(ExactTest, JudgesSurfelsOfKnownFault) {
  const ExactTest test = step_scene();
  const double voxel = static_cast<double>(0.01f) / 0.866;
  for (const KnownSurfel& known : known_surfels()) {
    SCOPED_TRACE(known.what);
    std::vector<Verdict> verdicts;
    const ExactScore score = test.score({known.surfel}, 0, 1, {}, &verdicts);
    ASSERT_EQ(verdicts.size(), 1u);
    EXPECT_EQ(verdicts[0], known.verdict);
    EXPECT_EQ(score.right, known.verdict == Verdict::kRight);
    EXPECT_EQ(score.buried, known.verdict == Verdict::kBuried);
    EXPECT_EQ(score.floating, known.verdict == Verdict::kFloating);
    EXPECT_EQ(score.flipped, known.verdict == Verdict::kFlipped);
    EXPECT_EQ(score.within_1v, known.distance <= voxel);
    EXPECT_EQ(score.within_2v, known.distance <= 2 * voxel);
    EXPECT_EQ(score.fdr_2cm, known.distance > 0.02);
    EXPECT_EQ(score.fdr_5cm, known.distance > 0.05);
  }
}

TEST(ExactTest, SharesAreOfAllSurfels) {
  std::vector<Surfel> surfels;
  std::vector<Verdict> expected, verdicts;
  for (const KnownSurfel& known : known_surfels()) {
    surfels.push_back(known.surfel);
    expected.push_back(known.verdict);
  }
  const ExactScore score = step_scene().score(surfels, 0, 2, {}, &verdicts);
  EXPECT_EQ(verdicts, expected);
  EXPECT_DOUBLE_EQ(score.right, 7 / 22.0);
  EXPECT_DOUBLE_EQ(score.buried, 3 / 22.0);
  EXPECT_DOUBLE_EQ(score.floating, 11 / 22.0);
  EXPECT_DOUBLE_EQ(score.flipped, 1 / 22.0);
  EXPECT_DOUBLE_EQ(score.within_1v, 7 / 22.0);
  EXPECT_DOUBLE_EQ(score.within_2v, 11 / 22.0);
  EXPECT_DOUBLE_EQ(score.fdr_2cm, 13 / 22.0);
  EXPECT_DOUBLE_EQ(score.fdr_5cm, 8 / 22.0);
}

/// Distance of a point from each part of the scene's boundary [m]. The parts count as infinite planes.
struct PlaneDistances {
  double left_wall, right_wall, step, sides;
  explicit PlaneDistances(const Vector3d& p)
      : left_wall(std::abs(p.z() - kLeft)),
        right_wall(std::abs(p.z() - kRight)),
        step(std::abs(p.x())),
        sides(std::min(std::abs(std::abs(p.x()) - kSide * p.z()) / std::hypot(1, kSide),
                       std::abs(std::abs(p.y()) - kTop * p.z()) / std::hypot(1, kTop))) {}
};

TEST(ExactTest, FindsTheBoundaryOfTheScene) {
  const std::vector<BoundaryPoint> boundary = step_scene().boundary(4000, 7);
  EXPECT_GT(boundary.size(), 3500u);
  std::size_t on_wall = 0, on_step = 0, on_side = 0;
  for (const BoundaryPoint& point : boundary) {
    const Vector3d& p = point.position;
    const PlaneDistances to(p);
    const double wall = p.x() < 0 ? to.left_wall : to.right_wall;
    const bool step_here = p.z() > kLeft - 1e-4 && p.z() < kRight + 1e-4;
    EXPECT_LT(std::min({wall, step_here ? to.step : kInf, to.sides}), 1e-4) << p.transpose();
    // The label of a point is certain if no other part of the boundary is near.
    if (to.sides > 0.01 && to.step > 0.01) {
      EXPECT_TRUE(point.occupied) << p.transpose();
      ++on_wall;
    } else if (to.step < 1e-4 && to.sides > 0.01 && p.z() > kLeft + 0.04 && p.z() < kRight - 0.01) {
      EXPECT_FALSE(point.occupied) << p.transpose();
      ++on_step;
    } else if (to.sides < 1e-4 && wall > 0.01 && to.step > 0.01) {
      EXPECT_FALSE(point.occupied) << p.transpose();
      ++on_side;
    }
  }
  EXPECT_GT(on_wall, 500u);
  EXPECT_GT(on_step, 100u);
  EXPECT_GT(on_side, 500u);
}

/// Number of boundary points on the sheet of unknown space between two cameras that face each other.
std::size_t points_on_sheet(double thickness) {
  ExactTest test(reading(0.5, 3, 1));
  Eigen::Isometry3d facing(Eigen::Translation3d(0, 0, 2 + thickness));
  facing.rotate(Eigen::AngleAxisd(M_PI, Vector3d::UnitY()));
  for (const Eigen::Isometry3d& pose : {Eigen::Isometry3d::Identity(), facing}) {
    OwnedFrame frame({15, 15, 14.5, 14.5, 30, 30}, pose, Encoding::kStepsU16, 0, false);
    for (int i = 0; i < 900; ++i) frame.set(i % 30, i / 30, 1);
    test.add(frame.view());
  }
  const auto boundary = test.boundary(8000, 3);
  return std::count_if(boundary.begin(), boundary.end(), [&](const BoundaryPoint& point) {
    const Vector3d& p = point.position;
    return p.head<2>().norm() < 0.5 && p.z() > 1 - 1e-4 && p.z() < 1 + thickness + 1e-4;
  });
}

TEST(ExactTest, ThinSheetsOfUnknownAreNoBoundary) {
  // Few rays need 2 cm to leave a sheet of 4 mm, many leave one of 17 mm within 2 cm, and none leaves one of 22 mm within 2 cm.
  const double thick = static_cast<double>(points_on_sheet(0.03));
  EXPECT_GT(thick, 500);
  EXPECT_LT(points_on_sheet(0.004), 0.1 * thick);
  EXPECT_LT(points_on_sheet(0.017), 0.85 * thick);
  EXPECT_GT(points_on_sheet(0.022), 0.9 * thick);
}

/// A grid of surfels on a rectangle of the boundary, 4 mm apart.
void add_grid(std::vector<Surfel>& surfels, const std::function<Vector3d(double, double)>& at, const Vector3d& normal,
              const std::function<Label(const Vector3d&)>& label) {
  constexpr int kSteps = 300;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Vector3d p = at(static_cast<double>(i) / kSteps, static_cast<double>(j) / kSteps);
      surfels.push_back(make_surfel(p, normal, 0.003, label(p)));
    }
  }
}

/// Surfels on all of the scene's boundary.
std::vector<Surfel> all_of_the_boundary() {
  const auto occupied = [](const Vector3d&) { return Label::kOccupied; };
  const auto frontier = [](const Vector3d&) { return Label::kFrontier; };
  const auto mix = [](double a, double b, double share) { return a + (b - a) * share; };
  std::vector<Surfel> surfels;
  add_grid(
      surfels, [&](double a, double b) -> Vector3d { return Vector3d(mix(-kSide, 0, a), mix(-kTop, kTop, b), 1) * kLeft; }, kTowards,
      occupied);
  add_grid(
      surfels, [&](double a, double b) -> Vector3d { return Vector3d(mix(0, kSide, a), mix(-kTop, kTop, b), 1) * kRight; }, kTowards,
      occupied);
  // The first 3 cm of the step lie just behind the left wall and count as occupied.
  add_grid(
      surfels, [&](double a, double b) -> Vector3d { return Vector3d(0, mix(-kTop, kTop, a) * kRight, mix(kLeft, kRight, b)); }, {1, 0, 0},
      [](const Vector3d& p) { return p.z() < kLeft + 0.03 ? Label::kOccupied : Label::kFrontier; });
  for (const double sign : {-1.0, 1.0}) {
    add_grid(
        surfels,
        [&](double a, double b) -> Vector3d { return Vector3d(sign * kSide, mix(-kTop, kTop, a), 1) * (sign < 0 ? kLeft : kRight) * b; },
        {-sign, 0, kSide}, frontier);
    add_grid(
        surfels, [&](double a, double b) -> Vector3d { return Vector3d(mix(-kSide, 0, a), sign * kTop, 1) * kLeft * b; }, {0, -sign, kTop},
        frontier);
    add_grid(
        surfels, [&](double a, double b) -> Vector3d { return Vector3d(mix(0, kSide, a), sign * kTop, 1) * kRight * b; }, {0, -sign, kTop},
        frontier);
  }
  return surfels;
}

TEST(ExactTest, CompleteMapMissesNothing) {
  const ExactTest test = step_scene();
  std::vector<Surfel> surfels = all_of_the_boundary();
  const ExactScore score = test.score(surfels, 10000, 2);
  EXPECT_EQ(score.boundary_points, test.boundary(10000, ExactTest::kSeed).size());
  EXPECT_EQ(score.miss_1cm, 0);
  EXPECT_EQ(score.miss_2cm, 0);
  EXPECT_EQ(score.miss_5cm, 0);
  EXPECT_GT(score.label_ok, 0.99);  // where two parts meet, the nearest surfel may belong to the other part

  for (Surfel& surfel : surfels) surfel.label = surfel.label == Label::kOccupied ? Label::kFrontier : Label::kOccupied;
  EXPECT_NEAR(test.score(surfels, 10000, 2).label_ok, 1 - score.label_ok, 1e-12);
}

TEST(ExactTest, MissingWallIsMissed) {
  const ExactTest test = step_scene();
  std::vector<Surfel> surfels;
  for (const Surfel& surfel : all_of_the_boundary()) {
    if (surfel.position.z() < kRight - 1e-4) surfels.push_back(surfel);  // all but the farther wall
  }
  std::size_t beyond_1cm = 0, beyond_2cm = 0, beyond_5cm = 0;
  const auto boundary = test.boundary(10000, ExactTest::kSeed);
  for (const BoundaryPoint& point : boundary) {
    const PlaneDistances to(point.position);
    if (to.right_wall > 1e-4) continue;
    const double rest = std::min(to.step, to.sides);  // distance to the other parts, up to the 4 mm between surfels
    beyond_1cm += rest > 0.01;
    beyond_2cm += rest > 0.02;
    beyond_5cm += rest > 0.05;
  }
  const double all = static_cast<double>(boundary.size());
  ASSERT_GT(beyond_5cm, 500u);
  const ExactScore score = test.score(surfels, 10000, 2);
  EXPECT_NEAR(score.miss_1cm, beyond_1cm / all, 0.005);
  EXPECT_NEAR(score.miss_2cm, beyond_2cm / all, 0.005);
  EXPECT_NEAR(score.miss_5cm, beyond_5cm / all, 0.005);
}

TEST(ExactTest, EmptyInputHasDefinedScores) {
  const ExactTest scene = step_scene(), no_frames(reading(0.5, 3, 4));
  const ExactScore no_surfels = scene.score({}, 1000);
  EXPECT_EQ(no_surfels.right + no_surfels.buried + no_surfels.floating + no_surfels.flipped, 0);
  EXPECT_EQ(no_surfels.fdr_2cm + no_surfels.within_2v, 0);
  EXPECT_GT(no_surfels.boundary_points, 900u);
  EXPECT_EQ(no_surfels.miss_1cm, 1);
  EXPECT_EQ(no_surfels.miss_5cm, 1);
  EXPECT_EQ(no_surfels.label_ok, 0);

  const ExactScore unseen = no_frames.score({make_surfel({0, 0, 1}, kTowards)}, 1000);
  EXPECT_EQ(unseen.floating, 1);
  EXPECT_EQ(unseen.fdr_5cm, 1);
  EXPECT_EQ(unseen.boundary_points, 0u);
  EXPECT_EQ(unseen.miss_1cm, 0);
  EXPECT_EQ(no_frames.score({}, 1000).boundary_points, 0u);

  ExactTest blind(reading(0.5, 3, 1));
  OwnedFrame nothing({10, 10, 2, 2, 5, 5}, Eigen::Isometry3d::Identity(), Encoding::kMetresF32, 0, false);
  for (int i = 0; i < 25; ++i) nothing.set(i % 5, i / 5, kNan);
  blind.add(nothing.view());
  EXPECT_EQ(blind.size(), 1u);
  EXPECT_EQ(blind.score({make_surfel({0, 0, 1}, kTowards)}, 1000).boundary_points, 0u);
}

TEST(ExactTest, RefusesFramesThatCannotBeUsed) {
  const auto refused = [](const std::function<void(DepthFrame&)>& spoil) {
    OwnedFrame frame({10, 10, 2, 2, 5, 5}, Eigen::Isometry3d::Identity(), Encoding::kMetresF32, 0, false);
    frame.view();
    spoil(frame.frame);
    ExactTest test(reading(0.5, 3, 1));
    EXPECT_THROW(test.add(frame.frame), BadFrame);
    EXPECT_EQ(test.size(), 0u);
  };
  refused([](DepthFrame& f) { f.T_world_camera = DepthFrame().T_world_camera; });
  refused([](DepthFrame& f) { f.T_world_camera.linear() *= 2; });
  refused([](DepthFrame& f) { f.depth.data = nullptr; });
  refused([](DepthFrame& f) { f.depth.height = 0; });
  refused([](DepthFrame& f) { f.depth.step = 19; });
  refused([](DepthFrame& f) { f.intrinsics.width = 4; });
  refused([](DepthFrame& f) { f.intrinsics.fy = 0; });
  refused([](DepthFrame& f) { f.intrinsics.cx = kNan; });
  EXPECT_THROW(ExactTest(reading(0, 3, 4)), Error);
  EXPECT_THROW(ExactTest(reading(0.5, kNan, 4)), Error);
  EXPECT_THROW(ExactTest(reading(0.5, 3, 0)), Error);
}

TEST(ExactTest, ProgressIsReportedOnTheCallersThreadAndCanStop) {
  const ExactTest test = step_scene();
  const std::vector<Surfel> surfels = all_of_the_boundary();
  std::vector<double> shares;
  bool own_thread = true;
  const auto caller = std::this_thread::get_id();
  test.score(surfels, 5000, 2, [&](double share) {
    own_thread &= std::this_thread::get_id() == caller;
    shares.push_back(share);
    return true;
  });
  EXPECT_TRUE(own_thread);
  ASSERT_FALSE(shares.empty());
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_GE(shares.front(), 0);
  EXPECT_EQ(shares.back(), 1);
  EXPECT_THROW(test.score(surfels, 5000, 2, [](double) { return false; }), Error);
  EXPECT_THROW(test.score(surfels, 5000, 2, [](double) -> bool { throw std::length_error("caller's own"); }), std::length_error);
}

}  // namespace
}  // namespace frontier_surfels::scoring
