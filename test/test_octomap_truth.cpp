/// The OctoMap truth compared with a map that accumulates OctoMap's log odds voxel by voxel, without a tree.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "exact_test_input.hpp"
#include "frontier_surfels/scoring/octomap_truth.hpp"

namespace frontier_surfels::scoring {
namespace {

using Voxel = std::array<int, 3>;

constexpr double kResolution = 0.1;  // [m]

Eigen::Vector3d centre(const Voxel& v) { return (Eigen::Vector3d(v[0], v[1], v[2]).array() + 0.5) * kResolution; }

Voxel voxel_of(const Surfel& surfel) {
  Voxel v;
  for (int axis = 0; axis < 3; ++axis) v[axis] = static_cast<int>(std::floor(surfel.position[axis] / kResolution));
  return v;
}

/// Occupancy as in OctoMap, without a tree: clamped sums of the log odds of hits and misses.
class SlowMap {
 public:
  void hit(const Voxel& v) { add(v, std::log(0.7 / 0.3)); }
  void miss(const Voxel& v) { add(v, std::log(0.4 / 0.6)); }
  bool known(const Voxel& v) const { return log_odds_.count(v) > 0; }
  bool occupied(const Voxel& v) const { return known(v) && log_odds_.at(v) >= 0; }
  std::size_t size() const { return log_odds_.size(); }

  /// Equations 17 and 18 for every voxel of a box.
  std::map<Voxel, Surfel> boundary(int low, int high) const {
    std::map<Voxel, Surfel> result;
    for (int x = low; x <= high; ++x) {
      for (int y = low; y <= high; ++y) {
        for (int z = low; z <= high; ++z) {
          Surfel surfel;
          if (!known({x, y, z}) && beside_known({x, y, z}, surfel)) result[{x, y, z}] = surfel;
        }
      }
    }
    return result;
  }

 private:
  void add(const Voxel& v, double change) { log_odds_[v] = std::clamp(log_odds_[v] + change, -2.0, 3.5); }

  bool beside_known(const Voxel& v, Surfel& surfel) const {
    bool beside = false, beside_occupied = false;
    Eigen::Vector3d sum(0, 0, 0);
    for (int n = 0; n < 27; ++n) {
      const Voxel step{n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1}, neighbour{v[0] + step[0], v[1] + step[1], v[2] + step[2]};
      if (!known(neighbour)) continue;
      const Eigen::Vector3d direction(step[0], step[1], step[2]);
      sum += direction.normalized();
      if (direction.norm() > 1) continue;
      beside = true;
      beside_occupied |= occupied(neighbour);
    }
    surfel.normal = sum.norm() < 1e-6 ? Eigen::Vector3f(0, 0, 1) : sum.normalized().cast<float>().eval();
    surfel.label = beside_occupied ? Label::kOccupied : Label::kFrontier;
    return beside;
  }

  std::map<Voxel, double> log_odds_;
};

/// Adds a view to both maps: a camera of one pixel in the centre of voxel `from` looks along an axis and measures a surface `steps` voxels
/// away.
void look(OctomapTruth& truth, SlowMap& slow, const Voxel& from, int axis, int steps) {
  const float depth = static_cast<float>(std::abs(steps) * kResolution);
  DepthFrame frame;
  frame.depth = {1, 1, sizeof(depth), DepthImage::Encoding::kMetresF32, &depth, false};
  frame.intrinsics = {10, 10, 0, 0, 1, 1};
  const auto unit = [&](int after) { return Eigen::Vector3d::Unit((axis + after) % 3).eval(); };
  frame.T_world_camera.setIdentity();
  frame.T_world_camera.translation() = centre(from);
  if (steps > 0) {
    frame.T_world_camera.linear() << unit(1), unit(2), unit(0);
  } else {
    frame.T_world_camera.linear() << unit(2), unit(1), -unit(0);
  }
  EXPECT_GT(truth.add(frame).wall_ms, 0);

  Voxel v = from;
  for (; v[axis] != from[axis] + steps; v[axis] += steps < 0 ? -1 : 1) slow.miss(v);
  slow.hit(v);
}

void expect_same_boundary(const OctomapTruth& truth, const std::map<Voxel, Surfel>& expected) {
  const std::vector<Surfel> boundary = truth.boundary();
  ASSERT_EQ(boundary.size(), expected.size());
  for (const Surfel& surfel : boundary) {
    const Voxel v = voxel_of(surfel);
    ASSERT_EQ(expected.count(v), 1u) << v[0] << " " << v[1] << " " << v[2];
    EXPECT_LT((surfel.position.cast<double>() - centre(v)).norm(), 1e-6);
    EXPECT_LT((surfel.normal - expected.at(v).normal).norm(), 1e-6);
    EXPECT_EQ(surfel.label, expected.at(v).label);
    EXPECT_FLOAT_EQ(surfel.radius, 0.0866025404f);
  }
}

TEST(OctomapTruth, BoundaryOfOneRay) {
  OctomapTruth truth(kResolution, reading(0.05, 3, 1));
  EXPECT_TRUE(truth.boundary().empty());
  SlowMap slow;
  look(truth, slow, {0, 0, 0}, 2, 4);
  // Five known voxels in a row: each has four neighbours beside the row, and each end has one more. The last voxel is occupied.
  const std::vector<Surfel> boundary = truth.boundary();
  ASSERT_EQ(boundary.size(), 5 * 4 + 2u);
  EXPECT_EQ(std::count_if(boundary.begin(), boundary.end(), [](const Surfel& s) { return s.label == Label::kOccupied; }), 5);
  expect_same_boundary(truth, slow.boundary(-2, 8));
}

TEST(OctomapTruth, BoundaryOfRandomTree) {
  OctomapTruth truth(kResolution, reading(0.05, 3, 1));
  SlowMap slow;
  std::mt19937 random(5);
  const auto pick = [&](int low, int high) { return low + static_cast<int>(random() % (high - low + 1)); };
  for (int i = 0; i < 300; ++i) {
    const int axis = pick(0, 2);
    Voxel from{pick(-8, 8), pick(-8, 8), pick(-8, 8)};
    look(truth, slow, from, axis, pick(1, 9) * (pick(0, 1) ? 1 : -1));
  }
  expect_same_boundary(truth, slow.boundary(-20, 20));
}

TEST(OctomapTruth, BoundaryOfPrunedTree) {
  OctomapTruth truth(kResolution, reading(0.05, 3, 1));
  SlowMap slow;
  const double empty_mb = truth.memory_mb();
  // After so many views all free voxels have the lowest log odds, and OctoMap merges them into large leaves.
  for (int again = 0; again < 6; ++again) {
    for (int x = 0; x < 13; ++x) {
      for (int y = 0; y < 12; ++y) look(truth, slow, {x, y, -3}, 2, x == 4 ? 17 : 20);
    }
  }
  EXPECT_GT(slow.size(), 2800u);
  // A node takes 16 bytes. With a node for each voxel the tree would take more memory than this.
  EXPECT_LT(truth.memory_mb() - empty_mb, 16e-6 * slow.size());
  EXPECT_GT(truth.memory_mb(), empty_mb);
  expect_same_boundary(truth, slow.boundary(-10, 25));
}

TEST(OctomapTruth, ReadsWhatTheMapperReads) {
  // After decimation by 2 the remaining pixels are: too near, NaN, 0.85 m, too far.
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> depth(5 * 4, 1.f);
  depth[0] = 0.4f;
  depth[2] = kNan;
  depth[10] = 0.85f;
  depth[12] = 3.01f;
  DepthFrame frame;
  frame.depth = {5, 4, 5 * sizeof(float), DepthImage::Encoding::kMetresF32, depth.data(), false};
  frame.intrinsics = {20, 20, 0, 2, 5, 4};
  frame.T_world_camera = Eigen::Isometry3d(Eigen::Translation3d(centre({0, 0, 0})));
  OctomapTruth truth(kResolution, nearest_reading(0.5, 3, 2));
  truth.add(frame);
  // Pixel (0, 1), the principal point: straight ahead, from z = 0.05 m to 0.9 m.
  SlowMap slow;
  for (int z = 0; z < 9; ++z) slow.miss({0, 0, z});
  slow.hit({0, 0, 9});
  expect_same_boundary(truth, slow.boundary(-3, 13));

  frame.T_world_camera = DepthFrame().T_world_camera;
  EXPECT_THROW(truth.add(frame), BadFrame);
  EXPECT_THROW(OctomapTruth(0, reading(0.5, 3, 1)), Error);
  EXPECT_THROW(OctomapTruth(0.1, reading(3, 0.5, 1)), Error);
  EXPECT_THROW(OctomapTruth(0.1, reading(0.5, 3, 0)), Error);
}

/// The ray of a carved pixel is free up to z_max, and the voxel in which it ends stays unknown. A measured surface beside it counts as
/// ever.
TEST(OctomapTruth, CarvesWhatTheConfigurationSays) {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  for (const float no_surface : {1.5F, kInf}) {
    const std::vector<float> depth = {no_surface, 0.75F};
    DepthFrame frame;
    frame.depth = {2, 1, 2 * sizeof(float), DepthImage::Encoding::kMetresF32, depth.data(), false};
    frame.intrinsics = {1000, 1000, 0, 0, 2, 1};
    frame.T_world_camera = Eigen::Isometry3d(Eigen::Translation3d(centre({0, 0, 0})));
    Config config = reading(0.5, 1.1, 1);
    config.carve_no_return = std::isinf(no_surface);
    config.carve_beyond_range = !std::isinf(no_surface);
    OctomapTruth truth(kResolution, config);
    truth.add(frame);
    SlowMap slow;
    for (int z = 0; z < 11; ++z) z == 8 ? slow.hit({0, 0, z}) : slow.miss({0, 0, z});
    expect_same_boundary(truth, slow.boundary(-3, 13));
    for (const Surfel& surfel : truth.boundary())
      EXPECT_TRUE(surfel.label == Label::kFrontier || voxel_of(surfel)[2] == 8) << "the end of a carved ray is no surface";
  }
}

TEST(OctomapTruth, FrameWithoutMeasurementsAddsNothing) {
  for (const std::uint16_t nothing : {0, 65535}) {
    DepthFrame frame;
    frame.depth = {1, 1, sizeof(nothing), DepthImage::Encoding::kStepsU16, &nothing, false};
    frame.intrinsics = {10, 10, 0, 0, 1, 1};
    frame.T_world_camera = Eigen::Isometry3d::Identity();
    Config config = reading(0.5, 3, 1);
    config.carve_beyond_range = true;
    OctomapTruth truth(kResolution, config);
    truth.add(frame);
    EXPECT_TRUE(truth.boundary().empty()) << nothing;
  }
}

TEST(OctomapTruth, SixteenBitsAreInTheConfiguredUnit) {
  const std::uint16_t steps = 4250;  // 0.85 m
  DepthFrame frame;
  frame.depth = {1, 1, sizeof(steps), DepthImage::Encoding::kStepsU16, &steps, false};
  frame.intrinsics = {10, 10, 0, 0, 1, 1};
  frame.T_world_camera = Eigen::Isometry3d(Eigen::Translation3d(centre({0, 0, 0})));
  Config config = reading(0.5, 3, 1);
  config.depth_unit = 0.0002;
  OctomapTruth truth(kResolution, config);
  truth.add(frame);
  SlowMap slow;
  for (int z = 0; z < 9; ++z) slow.miss({0, 0, z});
  slow.hit({0, 0, 9});
  expect_same_boundary(truth, slow.boundary(-3, 13));
}

std::vector<Surfel> at_x(const std::vector<double>& xs) {
  std::vector<Surfel> surfels(xs.size());
  for (std::size_t i = 0; i < xs.size(); ++i) surfels[i].position.x() = static_cast<float>(xs[i]);
  return surfels;
}

TEST(OctomapTruth, ScoreCountsSurfelsFarFromTheOtherMap) {
  const OctomapTruth truth(kResolution, reading(0.5, 3, 1));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const OctomapScore score = truth.score(at_x({0, 0.04, 0.06, 1.049, nan}), at_x({0, 1, 2, 3}));
  EXPECT_EQ(score.surfels, 4u);
  EXPECT_EQ(score.fp, 2u);  // 0.06 and NaN
  EXPECT_EQ(score.fn, 2u);  // 2 and 3
  EXPECT_DOUBLE_EQ(score.fdr, 2 / 5.0);
  EXPECT_DOUBLE_EQ(score.for_, 2 / 4.0);
  EXPECT_EQ(truth.score(at_x({0.06}), at_x({0}), 0.1).fp, 0u);

  const OctomapScore no_psi = truth.score({}, at_x({0, 1}));
  EXPECT_EQ(no_psi.fdr, 0);
  EXPECT_EQ(no_psi.for_, 1);
  const OctomapScore no_m = truth.score(at_x({0, 1}), {});
  EXPECT_EQ(no_m.fdr, 1);
  EXPECT_EQ(no_m.for_, 0);
  EXPECT_EQ(truth.score({}, {}).fdr, 0);
}

}  // namespace
}  // namespace frontier_surfels::scoring
