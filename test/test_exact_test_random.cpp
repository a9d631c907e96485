/// The exact test on random views and surfels, compared with a slow and literal implementation of its definition.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "exact_test_input.hpp"
#include "frontier_surfels/scoring/exact_test.hpp"

namespace frontier_surfels::scoring {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

struct SlowView {
  Intrinsics camera;
  Eigen::Isometry3d T_world_camera;
  std::vector<double> depth;  // depth of each pixel [m]; NaN: no measurement
};

struct RandomScene {
  static constexpr double kZMin = 0.4, kZMax = 2.5;
  static constexpr int kDecimation = 3;
  ExactTest test{nearest_reading(kZMin, kZMax, kDecimation)};
  std::vector<SlowView> views;
  std::vector<Surfel> surfels;
};

double random_depth(std::mt19937& random, int s, int t, double invalid_share) {
  std::uniform_real_distribution<double> uniform(0, 1);
  if (uniform(random) < invalid_share) {
    const double invalid[] = {0, kNan, kInf, -1, 0.3, 2.7};
    return invalid[random() % 6];
  }
  return std::round(1000 * (1.4 + 0.5 * std::sin(s / 17.0) * std::cos(t / 11.0) + 0.05 * uniform(random))) / 1000;
}

void add_random_view(RandomScene& scene, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const std::size_t index = scene.views.size();
  const int width = 97 + static_cast<int>(random() % 60), height = 71 + static_cast<int>(random() % 40);
  SlowView view{
      {90 + 20 * uniform(random), 130 + 20 * uniform(random), width / 2.0 + 5 * uniform(random), height / 2.0, width, height}, {}, {}};
  view.T_world_camera = Eigen::Translation3d(uniform(random), uniform(random), uniform(random)) *
                        Eigen::Quaterniond(uniform(random), uniform(random), uniform(random), uniform(random)).normalized();
  OwnedFrame frame(view.camera, view.T_world_camera, index % 2 ? Encoding::kMetresF32 : Encoding::kStepsU16, index % 3 * 5, index % 4 > 1);
  for (int t = 0; t < height; ++t) {
    for (int s = 0; s < width; ++s) {
      const double depth = random_depth(random, s, t, index % 3 == 0 ? 0.3 : 0.001 * (index % 3 - 1));
      frame.set(s, t, depth);
      view.depth.push_back(depth >= RandomScene::kZMin && depth <= RandomScene::kZMax ? depth : kNan);
    }
  }
  scene.test.add(frame.view());
  scene.views.push_back(view);
}

RandomScene random_scene() {
  RandomScene scene;
  std::mt19937 random(11);
  for (int i = 0; i < 14; ++i) add_random_view(scene, random);
  std::normal_distribution<double> normal(0, 1);
  const auto boundary = scene.test.boundary(4000, 5);
  for (const BoundaryPoint& point : boundary) {
    const double scatter = random() % 2 ? 0.01 : 0.1;
    const auto noise = [&] { return Vector3d(normal(random), normal(random), normal(random)); };
    scene.surfels.push_back(
        make_surfel(point.position + scatter * noise(), noise(), 0.002 + 0.01 * (random() % 4), static_cast<Label>(random() % 2)));
  }
  scene.surfels[3].position.y() = std::numeric_limits<float>::quiet_NaN();
  scene.surfels[4].radius = 0.9f;
  return scene;
}

/// Finds the measured depth at a point's pixel and the point's own depth. @return whether the point has a pixel with a measurement
bool slow_look(const SlowView& view, const Vector3d& p_world, double& depth, double& z) {
  const double n = RandomScene::kDecimation;
  const Vector3d p = view.T_world_camera.inverse() * p_world;
  z = p.z();
  const double s = std::floor(view.camera.fx / n * p.x() / z + view.camera.cx / n + 0.5);
  const double t = std::floor(view.camera.fy / n * p.y() / z + view.camera.cy / n + 0.5);
  if (!(z > 0) || !(s >= 0) || !(t >= 0) || s >= std::floor(view.camera.width / n) || t >= std::floor(view.camera.height / n)) return false;
  depth = view.depth[static_cast<std::size_t>(t * n * view.camera.width + s * n)];
  return !std::isnan(depth);
}

bool slow_known(const RandomScene& scene, const Vector3d& p) {
  for (const SlowView& view : scene.views) {
    double depth, z;
    if (slow_look(view, p, depth, z) && z < depth) return true;
  }
  return false;
}

double slow_distance(const RandomScene& scene, const Surfel& surfel) {
  double nearest = kInf;
  for (int i = -25; i < 25; ++i) {
    const auto at = [&](int step) { return Vector3d(surfel.position.cast<double>() + 0.002 * step * surfel.normal.cast<double>()); };
    if (!slow_known(scene, at(i)) && slow_known(scene, at(i + 1))) nearest = std::min(nearest, std::abs(0.002 * i + 0.001));
  }
  return nearest;
}

Verdict slow_verdict(const RandomScene& scene, const Surfel& surfel) {
  const Vector3d p = surfel.position.cast<double>(), n = surfel.normal.cast<double>();
  const bool back = slow_known(scene, p - 0.25 * surfel.radius * n), front = slow_known(scene, p + 1.75 * surfel.radius * n);
  if (back) return front ? Verdict::kBuried : Verdict::kFlipped;
  return front ? Verdict::kRight : Verdict::kFloating;
}

/// The part of the score that concerns surfels.
ExactScore slow_surfel_score(const RandomScene& scene, const std::vector<Verdict>& verdicts) {
  ExactScore score;
  const double one = 1.0 / scene.surfels.size();
  for (std::size_t i = 0; i < scene.surfels.size(); ++i) {
    const double distance = slow_distance(scene, scene.surfels[i]), voxel = scene.surfels[i].radius / 0.866;
    score.right += one * (verdicts[i] == Verdict::kRight);
    score.buried += one * (verdicts[i] == Verdict::kBuried);
    score.floating += one * (verdicts[i] == Verdict::kFloating);
    score.flipped += one * (verdicts[i] == Verdict::kFlipped);
    score.within_1v += one * (distance <= voxel);
    score.within_2v += one * (distance <= 2 * voxel);
    score.fdr_2cm += one * (distance > 0.02);
    score.fdr_5cm += one * (distance > 0.05);
  }
  return score;
}

/// The part of the score that concerns the boundary.
ExactScore slow_boundary_score(const RandomScene& scene, const std::vector<BoundaryPoint>& boundary) {
  ExactScore score;
  double labelled = 0;
  for (const BoundaryPoint& point : boundary) {
    double nearest = kInf;
    Label label{};
    for (const Surfel& surfel : scene.surfels) {
      const double distance = (surfel.position.cast<double>() - point.position).norm();
      if (distance < nearest) nearest = distance, label = surfel.label;
    }
    score.miss_1cm += nearest > 0.01;
    score.miss_2cm += nearest > 0.02;
    score.miss_5cm += nearest > 0.05;
    if (nearest > 0.02) continue;
    labelled += 1;
    score.label_ok += (label == Label::kOccupied) == point.occupied;
  }
  const double all = static_cast<double>(boundary.size());
  score.miss_1cm /= all;
  score.miss_2cm /= all;
  score.miss_5cm /= all;
  score.label_ok /= labelled;
  return score;
}

void expect_equal(const ExactScore& a, const ExactScore& b, double tolerance) {
  EXPECT_NEAR(a.right, b.right, tolerance);
  EXPECT_NEAR(a.buried, b.buried, tolerance);
  EXPECT_NEAR(a.floating, b.floating, tolerance);
  EXPECT_NEAR(a.flipped, b.flipped, tolerance);
  EXPECT_NEAR(a.within_1v, b.within_1v, tolerance);
  EXPECT_NEAR(a.within_2v, b.within_2v, tolerance);
  EXPECT_NEAR(a.fdr_2cm, b.fdr_2cm, tolerance);
  EXPECT_NEAR(a.fdr_5cm, b.fdr_5cm, tolerance);
  EXPECT_NEAR(a.miss_1cm, b.miss_1cm, tolerance);
  EXPECT_NEAR(a.miss_2cm, b.miss_2cm, tolerance);
  EXPECT_NEAR(a.miss_5cm, b.miss_5cm, tolerance);
  EXPECT_NEAR(a.label_ok, b.label_ok, tolerance);
}

TEST(ExactTestRandom, AgreesWithTheSlowImplementation) {
  const RandomScene scene = random_scene();
  ASSERT_GT(scene.surfels.size(), 3000u);
  std::vector<Verdict> verdicts, expected_verdicts;
  const ExactScore score = scene.test.score(scene.surfels, 3000, 2, {}, &verdicts);
  for (const Surfel& surfel : scene.surfels) expected_verdicts.push_back(slow_verdict(scene, surfel));
  EXPECT_EQ(verdicts, expected_verdicts);

  const auto boundary = scene.test.boundary(3000, ExactTest::kSeed);
  ExactScore expected = slow_surfel_score(scene, expected_verdicts);
  const ExactScore completeness = slow_boundary_score(scene, boundary);
  expected.miss_1cm = completeness.miss_1cm;
  expected.miss_2cm = completeness.miss_2cm;
  expected.miss_5cm = completeness.miss_5cm;
  expected.label_ok = completeness.label_ok;
  EXPECT_EQ(score.boundary_points, boundary.size());
  expect_equal(score, expected, 1e-9);
  for (const double share : {score.right, score.buried, score.floating, score.flipped, score.within_1v, score.miss_2cm, score.label_ok}) {
    EXPECT_GT(share, 0.02);  // every outcome occurs in the comparison
    EXPECT_LT(share, 0.98);
  }
}

TEST(ExactTestRandom, BoundaryPointsLieBetweenKnownAndUnknown) {
  const RandomScene scene = random_scene();
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 1);
  for (const BoundaryPoint& point : scene.test.boundary(1000, 9)) {
    bool known = false, unknown = false;
    for (int i = 0; i < 200 && !(known && unknown); ++i) {
      const Vector3d direction = Vector3d(normal(random), normal(random), normal(random)).normalized();
      (slow_known(scene, point.position + 1e-4 * direction) ? known : unknown) = true;
    }
    EXPECT_TRUE(known && unknown) << point.position.transpose();
  }
}

TEST(ExactTestRandom, ResultDoesNotDependOnThreads) {
  const RandomScene scene = random_scene();
  std::vector<Verdict> one_thread, two_threads;
  const ExactScore a = scene.test.score(scene.surfels, 3000, 1, {}, &one_thread);
  const ExactScore b = scene.test.score(scene.surfels, 3000, 2, {}, &two_threads);
  EXPECT_EQ(one_thread, two_threads);
  EXPECT_EQ(a.boundary_points, b.boundary_points);
  expect_equal(a, b, 0);
  const auto p = scene.test.boundary(500, 4, 1), q = scene.test.boundary(500, 4, 2), other = scene.test.boundary(500, 5, 2);
  ASSERT_EQ(p.size(), q.size());
  for (std::size_t i = 0; i < p.size(); ++i) {
    EXPECT_EQ(p[i].position, q[i].position);
    EXPECT_EQ(p[i].occupied, q[i].occupied);
  }
  EXPECT_NE(p[0].position, other[0].position);
}

}  // namespace
}  // namespace frontier_surfels::scoring
