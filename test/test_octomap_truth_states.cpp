/// OctoMap's tree as a grid of states, compared with a tree that OctoMap builds itself from the same points, cell by cell.
#include <gtest/gtest.h>
#include <octomap/octomap.h>

#include <algorithm>
#include <array>
#include <limits>
#include <random>
#include <vector>

#include "exact_test_input.hpp"
#include "frontier_surfels/scoring/octomap_truth.hpp"

namespace frontier_surfels::scoring {
namespace {

constexpr double kResolution = 0.1;  // [m]
constexpr int kReach = 45;           // cells from the origin that are compared: more than the views see

/// What OctoMap says of a place.
SpaceState slow_state(const octomap::OcTree& tree, const Eigen::Vector3f& p) {
  const octomap::OcTreeNode* node = tree.search(p.x(), p.y(), p.z());
  if (node == nullptr) return SpaceState::kUnknown;
  return tree.isNodeOccupied(node) ? SpaceState::kOccupied : SpaceState::kFree;
}

struct TestOctomapStates : testing::Test {
  /// A camera sees these depths [m], one for each of its pixels.
  void look(const Eigen::Isometry3d& T_world_camera, const Intrinsics& camera, const std::vector<float>& depths) {
    DepthFrame frame;
    frame.depth = {camera.width, camera.height, camera.width * sizeof(float), DepthImage::Encoding::kMetresF32, depths.data(), false};
    frame.intrinsics = camera;
    frame.T_world_camera = T_world_camera;
    truth.add(frame);

    octomap::Pointcloud cloud;
    for (int v = 0; v < camera.height; ++v)
      for (int u = 0; u < camera.width; ++u) {
        const double d = depths[static_cast<std::size_t>(v * camera.width + u)];
        if (!(d <= 3)) continue;
        const Eigen::Vector3d ray((u - camera.cx) * d / camera.fx, (v - camera.cy) * d / camera.fy, d);
        const Eigen::Vector3f p = (T_world_camera * ray).cast<float>();
        cloud.push_back(p.x(), p.y(), p.z());
      }
    const Eigen::Vector3f eye = T_world_camera.translation().cast<float>();
    tree.insertPointCloud(cloud, {eye.x(), eye.y(), eye.z()});
  }

  /// Compares all cells, and returns how many are of each state.
  std::array<int, 3> compare() const {
    StateGrid grid(kResolution);
    EXPECT_TRUE(grid.apply(truth.states(17)));
    EXPECT_EQ(grid.sequence(), 17U);
    std::array<int, 3> counts = {0, 0, 0};
    for (int x = -kReach; x < kReach; ++x)
      for (int y = -kReach; y < kReach; ++y)
        for (int z = -kReach; z < kReach; ++z) {
          const Eigen::Vector3f p = ((Eigen::Array3d(x, y, z) + 0.5) * kResolution).matrix().cast<float>();
          const SpaceState state = grid.state(p);
          EXPECT_EQ(state, slow_state(tree, p)) << p.transpose();
          if (HasFailure()) return counts;
          ++counts[static_cast<std::size_t>(state)];
        }
    return counts;
  }

  std::mt19937 random{21};
  OctomapTruth truth{kResolution, reading(0.05, 3, 1)};
  octomap::OcTree tree{kResolution};
};

TEST_F(TestOctomapStates, RandomViewsInAllOctants) {
  std::uniform_real_distribution<double> place(-1, 1);
  for (int n = 0; n < 16; ++n) {
    const double x = place(random), y = place(random), z = place(random), angle = 3 * place(random);
    const Eigen::Vector3d axis = Eigen::Vector3d(z, x, y + 0.1).normalized();
    std::uniform_real_distribution<float> depth(0.3F, 3);
    std::vector<float> depths(20 * 15);
    for (float& d : depths) d = random() % 20 == 0 ? std::numeric_limits<float>::quiet_NaN() : depth(random);
    look(Eigen::Translation3d(x, y, z) * Eigen::AngleAxisd(angle, axis), {15, 15, 9.5, 7, 20, 15}, depths);
  }
  const auto [unknown, free, occupied] = compare();
  EXPECT_GT(unknown, 1000);
  EXPECT_GT(free, 1000);
  EXPECT_GT(occupied, 1000);
}

/// From the middle of a box that is seen often enough, all that is free gets the lowest log odds, and OctoMap merges it into a leaf of
/// 32^3 voxels: eight blocks of the grid.
TEST_F(TestOctomapStates, PrunedLeavesAreLargerThanABlock) {
  const std::vector<float> depths(84 * 84, 1.85F);
  for (int again = 0; again < 6; ++again)
    for (int face = 0; face < 6; ++face) {
      const Eigen::Vector3d forward = Eigen::Vector3d::Unit(face / 2) * (face % 2 == 0 ? 1 : -1);
      const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), forward);
      look(Eigen::Translation3d(-1.59, -1.59, -1.59) * turn, {40, 40, 41.5, 41.5, 84, 84}, depths);
    }
  unsigned largest = 0;
  for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf)
    largest = std::max(largest, 1U << (16 - leaf.getDepth()));
  EXPECT_EQ(largest, 32U);
  EXPECT_GT(compare()[1], 32 * 32 * 32);
}

TEST_F(TestOctomapStates, OfAnEmptyTree) {
  const StateChanges none = truth.states(3);
  EXPECT_EQ(none.sequence, 3U);
  EXPECT_EQ(none.since, 0U);
  EXPECT_EQ(none.resolution, kResolution);
  EXPECT_TRUE(none.blocks.empty());
  EXPECT_EQ(compare()[0], 8 * kReach * kReach * kReach);
}

}  // namespace
}  // namespace frontier_surfels::scoring
