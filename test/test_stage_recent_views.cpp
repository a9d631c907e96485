/// The kernels of the recent views, and their ring, against the exact test of every candidate in every kept view.

#include <gtest/gtest.h>

#include "stages/reference_paths.hpp"
#include "stages/reference_views.hpp"
#include "stages/stages_probe.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// An image of a wall, a little rough and with holes: unlike random depths it hides what is behind, so that tiles need not ask the view.
WorkingImage wall_image(const Camera& camera, Random& random) {
  WorkingImage image = random_image(camera, Content::all_invalid, random);
  const double distance = random.uniform(camera.config.z_min, 1.2 * camera.config.z_max);
  for (float& d : image.depth)
    if (random.chance(0.9)) d = static_cast<float>(distance * random.uniform(0.98, 1.02)) * (random.chance(0.1) ? -1.0F : 1.0F);
  return image;
}

/// @param frames  views before the current one, of which the last config.recent_views are kept
/// @param walls   those views see walls, from anywhere around
/// @return share of candidates that a view knows
double check(Camera camera, int frames, int kept, Content content, double density, bool walls = false) {
  SCOPED_TRACE(camera.name + ", " + std::to_string(frames) + " frames, " + std::to_string(kept) + " views kept, density " +
               std::to_string(density));
  camera.config.recent_views = kept;
  Random random(static_cast<unsigned>(frames));
  StagesProbe probe(camera.config);
  std::vector<SeenView> views;
  const Eigen::Isometry3d T_world_start = random.pose(2, 3);
  for (int frame = 0; frame < frames; ++frame) {
    views.push_back({walls ? wall_image(camera, random) : random_image(camera, content, random),
                     T_world_start * (walls ? random.pose(0.8 * camera.config.z_max, M_PI) : random.pose(0.5, 0.6)),
                     depth_step_for(camera.config.z_max)});
    probe.views().set_current(views.back().image, views.back().T_world_camera);
    EXPECT_EQ(probe.views().keep_current(), kept > 0);
  }
  if (static_cast<int>(views.size()) > kept) views.erase(views.begin(), views.end() - kept);
  probe.stages().begin_frame(random_image(camera, Content::all_valid, random), T_world_start, 2);
  const Field<char> candidates = random_field(probe.grid(), density, random);
  probe.set_candidates(candidates);

  probe.stages().settle_by_recent_views();
  const Nuvg grid(camera.intrinsics, camera.config);
  Field<Truth> expected = grid.field(Truth::no);
  double known = 0, all = 0;
  for_each_voxel(candidates, [&](int i, int j, int k) {
    if (!candidates(i, j, k)) return;
    expected(i, j, k) = !any_knows(views, T_world_start * grid.center_of(i, j, k));
    ++all;
    known += expected(i, j, k) == Truth::no;
  });
  const Field<char> left = probe.candidates();
  expect_equal("candidates left", expected, left);

  // The paths that the known space must be computed on: two voxels around what is left.
  const std::vector<Field<char>> paths = paths_through(around(left, 2)), actual = probe.needed_paths();
  for (int family = 0; family < 3; ++family) expect_equal("needed paths, family " + std::to_string(family), paths[family], actual[family]);
  return all > 0 ? known / all : 0;
}

TEST(StageRecentViews, RandomViews) {
  double known = 0;
  for (const Camera& camera : cameras()) known = std::max(known, check(camera, 4, 10, Content::mixed, 0.1));
  EXPECT_GT(known, 0.1) << "nothing was tested";
}

TEST(StageRecentViews, FewCandidates) {
  for (const Camera& camera : cameras()) check(camera, 3, 10, Content::all_valid, 0.002);
}

TEST(StageRecentViews, EveryVoxelIsACandidate) { check(cameras().front(), 3, 10, Content::all_valid, 1); }

/// More views than a vector has lanes, most of which can know nothing of most tiles, and say so.
TEST(StageRecentViews, ViewsOfWallsFromAnywhere) {
  double known = 0;
  for (const Camera& camera : cameras())
    for (const double density : {0.002, 0.2})
      for (const int frames : {15, 16, 17, 40}) known = std::max(known, check(camera, frames, 40, Content::mixed, density, true));
  EXPECT_GT(known, 0.1) << "nothing was tested";
}

TEST(StageRecentViews, NoCandidates) { check(cameras().front(), 3, 10, Content::all_valid, 0); }

TEST(StageRecentViews, NothingIsKnownToEmptyViews) { EXPECT_EQ(check(cameras().front(), 3, 10, Content::all_invalid, 0.3), 0); }

TEST(StageRecentViews, NoViews) {
  EXPECT_EQ(check(cameras().front(), 0, 10, Content::mixed, 0.3), 0);
  EXPECT_EQ(check(cameras().front(), 2, 0, Content::mixed, 0.3), 0);
}

/// Only the newest views count.
TEST(StageRecentViews, RingForgets) {
  for (const int kept : {1, 2, 3}) check(cameras().front(), 7, kept, Content::mixed, 0.3);
}

TEST(StageRecentViews, KeepsOnlyViewsThatAddSomething) {
  Camera camera = cameras().front();
  camera.config.recent_view_distance = 0.1;
  camera.config.recent_view_angle = 5;
  Random random(1);
  StagesProbe probe(camera.config);
  const auto keeps = [&](double x, double degrees) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().x() = x;
    T.linear() = Eigen::AngleAxisd(degrees * M_PI / 180, Eigen::Vector3d::UnitY()).toRotationMatrix();
    probe.views().set_current(random_image(camera, Content::mixed, random), T);
    return probe.views().keep_current();
  };
  EXPECT_TRUE(keeps(0, 0));
  EXPECT_FALSE(keeps(0, 0));
  EXPECT_FALSE(keeps(0.09, 4.5));
  EXPECT_TRUE(keeps(0.11, 0));
  EXPECT_TRUE(keeps(0, 5.5));
  EXPECT_FALSE(keeps(0.15, 0)) << "near the second view";
  EXPECT_EQ(probe.views().count(), 3u);
}

/// While no view was ever forgotten they alone know what is known, and nothing is left for the surfels to decide.
TEST(StageRecentViews, CompleteUntilOneIsForgotten) {
  Camera camera = cameras().front();
  camera.config.recent_views = 2;
  Random random(3);
  StagesProbe probe(camera.config);
  EXPECT_TRUE(probe.stages().is_open()) << "a map was loaded, say";
  probe.views().clear(true);
  for (const bool open : {false, false, true, true}) {
    probe.stages().begin_frame(random_image(camera, Content::mixed, random), random.pose(2, 3), 1);
    EXPECT_TRUE(probe.views().keep_current());
    EXPECT_EQ(probe.stages().is_open(), open);
  }
}

/// Whole steps of depth, rounded down, patch by patch, and behind them the largest of each block: of odd sizes, and with as many steps as
/// there are.
TEST(StageRecentViews, StoredDepths) {
  for (Camera camera : cameras()) {
    for (const double z_max : {camera.config.z_max, 4.0}) {
      SCOPED_TRACE(camera.name + ", z_max " + std::to_string(z_max));
      camera.config.z_max = z_max;
      Random random(5);
      StagesProbe probe(camera.config);
      const WorkingImage image = random_image(camera, Content::mixed, random);
      probe.views().set_current(image, Eigen::Isometry3d::Identity());
      const int width = image.intrinsics.width, height = image.intrinsics.height;
      const auto up = [](int size, int part) { return (size + part - 1) / part; };
      const int patches_i = up(width, 8), blocks_i = up(width, VIEW_BLOCK), pixels = 32 * patches_i * up(height, 4);
      std::vector<cl_ushort> stored(pixels + blocks_i * up(height, VIEW_BLOCK));
      test_commands().queue().enqueueReadBuffer(probe.views().depths(), CL_TRUE, probe.views().own_view().first_pixel * sizeof(cl_ushort),
                                                stored.size() * sizeof(cl_ushort), stored.data());
      std::vector<double> expected(stored.size(), 0);
      for (int t = 0; t < height; ++t)
        for (int s = 0; s < width; ++s) {
          double& largest = expected[pixels + t / VIEW_BLOCK * blocks_i + s / VIEW_BLOCK];
          double& pixel = expected[32 * (t / 4 * patches_i + s / 8) + 8 * (t % 4) + s % 8];
          pixel = kept_steps(image.depth[t * width + s], depth_step_for(z_max));
          largest = std::max(largest, pixel);
        }
      EXPECT_EQ(std::vector<double>(stored.begin(), stored.end()), expected);
    }
  }
}

/// More pixels than can be numbered are refused, and a smaller image is taken afterwards.
TEST(StageRecentViews, TooManyPixels) {
  Config config;
  config.recent_views = 1024;
  Random random(6);
  StagesProbe probe(config);
  const Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
  const WorkingImage large = random_image(make_camera(1500, 1400, 300, 300, 45), Content::all_invalid, random);
  EXPECT_THROW(probe.views().set_current(large, here), BadFrame);
  probe.views().set_current(random_image(cameras().front(), Content::all_valid, random), here);
  EXPECT_TRUE(probe.views().keep_current());
}

/// A larger image than ever before has no room beside the kept ones: they go, and nothing is mixed up.
TEST(StageRecentViews, LargerImages) {
  const Camera small = cameras().front(), large = make_camera(20, 15, 15.1, 15.3, 45);
  Random random(2);
  StagesProbe probe(small.config);
  const Eigen::Isometry3d near = random.pose(0.1, 0.1), here = Eigen::Isometry3d::Identity();
  const SeenView before = {random_image(small, Content::all_valid, random), near, depth_step_for(small.config.z_max)};
  probe.views().set_current(before.image, near);
  EXPECT_TRUE(probe.views().keep_current());
  probe.stages().begin_frame(random_image(large, Content::all_valid, random), here, 2);
  EXPECT_EQ(probe.views().count(), 0u);
  EXPECT_TRUE(probe.views().keep_current());
  probe.views().set_current(before.image, near);  // smaller ones fit
  EXPECT_TRUE(probe.views().keep_current());
  EXPECT_EQ(probe.views().count(), 2u);
}

}  // namespace
}  // namespace frontier_surfels
