/// The recent views and their kernels, compared with the exact test of every candidate in every kept view.

#include <gtest/gtest.h>

#include "stages/path_fields.hpp"
#include "stages/reference_paths.hpp"
#include "stages/reference_views.hpp"
#include "stages/view_settling.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// An image of a slightly rough wall with holes. Unlike random depths it hides the space behind it, so that many tiles can skip the view.
WorkingImage wall_image(const CameraSetup& camera, Random& random) {
  WorkingImage image = random_image(camera, Content::all_invalid, random);
  const double distance = random.uniform(camera.config.z_min, 1.2 * camera.config.z_max);
  for (float& d : image.depth)
    if (random.chance(0.9)) d = static_cast<float>(distance * random.uniform(0.98, 1.02)) * (random.chance(0.1) ? -1.0F : 1.0F);
  return image;
}

/// Expects that a frame of this camera keeps exactly the candidates that no view knows. @return share of the candidates that a view knows
double expect_settled(FrameFixture& fixture, const CameraSetup& camera, const std::vector<SeenView>& views,
                      const Eigen::Isometry3d& T_world_camera, Random& random, double density, Candidates& left) {
  fixture.begin(random_image(camera, Content::all_valid, random), T_world_camera);
  const Field<char> candidates = random_field(fixture.grid(), density, random);
  fixture.write(left, candidates);
  ViewSettling settling(fixture.commands());
  settling.settle(fixture.frame(), fixture.camera(), fixture.views(), fixture.seen(), fixture.taken(), left);
  const Nuvg grid(camera.intrinsics, camera.config);
  Field<Truth> expected = grid.field(Truth::no);
  double known = 0, all = 0;
  for_each_voxel(candidates, [&](int i, int j, int k) {
    if (!candidates(i, j, k)) return;
    expected(i, j, k) = !any_knows(views, T_world_camera * grid.center_of(i, j, k));
    ++all;
    known += expected(i, j, k) == Truth::no;
  });
  expect_equal("candidates left", expected, fixture.read(left));
  return all > 0 ? known / all : 0;
}

/// @param frames  number of views before the current one
/// @param kept    value of recent_views: maximum number of kept views
/// @param walls   the views see walls, from anywhere around
/// @return share of candidates that a view knows
double check(CameraSetup camera, int frames, int kept, Content content, double density, bool walls = false) {
  SCOPED_TRACE(camera.name + ", " + std::to_string(frames) + " frames, " + std::to_string(kept) + " views kept, density " +
               std::to_string(density));
  camera.config.recent_views = kept;
  Random random(static_cast<unsigned>(frames));
  FrameFixture fixture(camera.config);
  std::vector<SeenView> views;
  const Eigen::Isometry3d T_world_start = random.pose(2, 3);
  for (int frame = 0; frame < frames; ++frame) {
    views.push_back({walls ? wall_image(camera, random) : random_image(camera, content, random),
                     T_world_start * (walls ? random.pose(0.8 * camera.config.z_max, M_PI) : random.pose(0.5, 0.6)),
                     depth_step_for(camera.config.z_max)});
    fixture.views().set_current(views.back().image, views.back().T_world_camera);
    EXPECT_EQ(fixture.views().keep_current(), kept > 0);
  }
  if (static_cast<int>(views.size()) > kept) views.erase(views.begin(), views.end() - kept);
  Candidates left(fixture.commands());
  const double known = expect_settled(fixture, camera, views, T_world_start, random, density, left);

  // Known space must be computed on the paths through all voxels within two voxels of a candidate left.
  NeededPaths needed(fixture.commands());
  needed.mark(fixture.frame(), left);
  const std::vector<Field<char>> paths = paths_through(around(fixture.read(left), 2)), actual = read_paths(fixture.grid(), needed);
  for (int family = 0; family < 3; ++family) expect_equal("needed paths, family " + std::to_string(family), paths[family], actual[family]);
  return known;
}

TEST(StageRecentViews, RandomViews) {
  double known = 0;
  for (const CameraSetup& camera : cameras()) known = std::max(known, check(camera, 4, 10, Content::mixed, 0.1));
  EXPECT_GT(known, 0.1) << "nothing was tested";
}

TEST(StageRecentViews, FewCandidates) {
  for (const CameraSetup& camera : cameras()) check(camera, 3, 10, Content::all_valid, 0.002);
}

TEST(StageRecentViews, EveryVoxelIsACandidate) { check(cameras().front(), 3, 10, Content::all_valid, 1); }

/// More views than a vector has lanes. Most views know nothing of most tiles, and the tiles skip them.
TEST(StageRecentViews, ViewsOfWallsFromAnywhere) {
  double known = 0;
  for (const CameraSetup& camera : cameras())
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

/// Where the visit has found surfels to be split, it is repeated: no candidate is left for the stages that would look at them in vain.
TEST(StageRecentViews, NoCandidateIsLeftWhereSurfelsMustBeSplit) {
  for (const CameraSetup& camera : cameras()) {
    Random random(3);
    FrameFixture fixture(camera.config);
    fixture.views().set_current(random_image(camera, Content::mixed, random), Eigen::Isometry3d::Identity());
    ASSERT_TRUE(fixture.views().keep_current());
    fixture.begin(random_image(camera, Content::all_valid, random), random.pose(0.5, 0.6));
    Candidates left(fixture.commands());
    const Field<char> candidates = random_field(fixture.grid(), 0.3, random);
    fixture.write(left, candidates);
    std::vector<cl_uint> counts(COUNTS, 0);
    counts[COUNT_LARGE] = 1;
    left.visit_counts().write(counts);
    ViewSettling settling(fixture.commands());
    settling.settle(fixture.frame(), fixture.camera(), fixture.views(), fixture.seen(), fixture.taken(), left);
    expect_equal("candidates left", Field<char>(fixture.grid(), 0), fixture.read(left));
  }
}

/// Only the newest views count.
TEST(StageRecentViews, RingForgets) {
  for (const int kept : {1, 2, 3}) check(cameras().front(), 7, kept, Content::mixed, 0.3);
}

TEST(StageRecentViews, KeepsOnlyViewsThatAddSomething) {
  CameraSetup camera = cameras().front();
  camera.config.recent_view_distance = 0.1;
  camera.config.recent_view_angle = 5;
  Random random(1);
  FrameFixture fixture(camera.config);
  const auto keeps = [&](double x, double degrees) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().x() = x;
    T.linear() = Eigen::AngleAxisd(degrees * M_PI / 180, Eigen::Vector3d::UnitY()).toRotationMatrix();
    fixture.views().set_current(random_image(camera, Content::mixed, random), T);
    return fixture.views().keep_current();
  };
  EXPECT_TRUE(keeps(0, 0));
  EXPECT_FALSE(keeps(0, 0));
  EXPECT_FALSE(keeps(0.09, 4.5));
  EXPECT_TRUE(keeps(0.11, 0));
  EXPECT_TRUE(keeps(0, 5.5));
  EXPECT_FALSE(keeps(0.15, 0)) << "near the second view";
  EXPECT_EQ(fixture.views().count(), 3u);
}

/// As long as no view was forgotten, the views alone know all known space.
TEST(StageRecentViews, CompleteUntilOneIsForgotten) {
  CameraSetup camera = cameras().front();
  camera.config.recent_views = 2;
  Random random(3);
  FrameFixture fixture(camera.config);
  EXPECT_FALSE(fixture.views().complete()) << "the map was not empty";
  fixture.views().clear(true);
  for (const bool complete : {true, true, false, false}) {
    fixture.begin(random_image(camera, Content::mixed, random), random.pose(2, 3));
    EXPECT_TRUE(fixture.views().keep_current());
    EXPECT_EQ(fixture.views().complete(), complete);
  }
}

/// Depths are stored in whole steps, rounded down, patch by patch, followed by the largest depth of each block. Tested with odd image sizes
/// and with depths that need all 16 bits.
TEST(StageRecentViews, StoredDepths) {
  for (CameraSetup camera : cameras()) {
    for (const double z_max : {camera.config.z_max, 4.0}) {
      SCOPED_TRACE(camera.name + ", z_max " + std::to_string(z_max));
      camera.config.z_max = z_max;
      Random random(5);
      FrameFixture fixture(camera.config);
      const WorkingImage image = random_image(camera, Content::mixed, random);
      fixture.views().set_current(image, Eigen::Isometry3d::Identity());
      const int width = image.intrinsics.width, height = image.intrinsics.height;
      const auto up = [](int size, int part) { return (size + part - 1) / part; };
      const int patches_i = up(width, 8), blocks_i = up(width, VIEW_BLOCK), pixels = 32 * patches_i * up(height, 4);
      std::vector<cl_ushort> stored(pixels + blocks_i * up(height, VIEW_BLOCK));
      test_commands().queue().enqueueReadBuffer(fixture.views().depths(), CL_TRUE,
                                                fixture.views().own_view().first_pixel * sizeof(cl_ushort),
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

/// Images with more pixels than 32 bits can number are refused. A smaller image is accepted afterwards.
TEST(StageRecentViews, TooManyPixels) {
  Config config;
  config.recent_views = 1024;
  Random random(6);
  FrameFixture fixture(config);
  const Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
  const WorkingImage large = random_image(make_camera(1500, 1400, 300, 300, 45), Content::all_invalid, random);
  EXPECT_THROW(fixture.views().set_current(large, here), BadFrame);
  fixture.views().set_current(random_image(cameras().front(), Content::all_valid, random), here);
  EXPECT_TRUE(fixture.views().keep_current());
}

/// When a larger image than before comes, the kept views are copied and know the same as before.
TEST(StageRecentViews, LargerImages) {
  const CameraSetup small = cameras().front();
  CameraSetup large = make_camera(20, 15, 15.1, 15.3, 45);
  large.config = small.config;
  Random random(2);
  FrameFixture fixture(small.config);
  const double depth_step = depth_step_for(small.config.z_max);
  const Eigen::Isometry3d here = random.pose(2, 3);
  std::vector<SeenView> views;
  const auto keep = [&](const CameraSetup& camera) {
    views.push_back({random_image(camera, Content::all_valid, random), here * random.pose(0.3, 0.3), depth_step});
    fixture.views().set_current(views.back().image, views.back().T_world_camera);
    EXPECT_TRUE(fixture.views().keep_current());
  };
  for (const CameraSetup& camera : {small, small, small, large, small, large}) keep(camera);
  EXPECT_EQ(fixture.views().count(), 6u);
  for (const CameraSetup& camera : {small, large}) {
    Candidates left(fixture.commands());
    EXPECT_GT(expect_settled(fixture, camera, views, here, random, 0.3, left), 0.1) << "nothing was tested";
  }
}

/// Views of different cameras with the same pose are both kept.
TEST(StageRecentViews, CamerasSideBySide) {
  const CameraSetup one = cameras().front(), other = make_camera(7, 5, 20.3, 24.1, 33);
  Random random(4);
  FrameFixture fixture(one.config);
  for (const bool is_new : {true, false})
    for (const CameraSetup& camera : {one, other}) {
      fixture.views().set_current(random_image(camera, Content::all_valid, random), Eigen::Isometry3d::Identity());
      EXPECT_EQ(fixture.views().keep_current(), is_new);
    }
  EXPECT_EQ(fixture.views().count(), 2u);
}

}  // namespace
}  // namespace frontier_surfels
