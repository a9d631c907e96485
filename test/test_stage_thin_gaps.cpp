/// Candidates on thin sheets of unknown space, compared with the exact test of the point behind every candidate in every view.

#include <gtest/gtest.h>

#include "stages/frame_fixture.hpp"
#include "stages/observed_space.hpp"
#include "stages/reference_observed_space.hpp"
#include "stages/reference_paths.hpp"
#include "stages/reference_views.hpp"
#include "stages/thin_gaps.hpp"
#include "stages/view_settling.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

struct Scene {
  CameraSetup camera;
  Nuvg grid;
  SeenView current;
  std::vector<SeenView> kept;
  std::vector<float> layer_depth;
  Field<char> observed;
};

/// Numbers of candidates that no view knows.
struct Tally {
  std::size_t by_current = 0;   ///< on gaps that only the current view closes
  std::size_t by_kept = 0;      ///< on gaps that only kept views close
  std::size_t at_surfaces = 0;  ///< on such gaps, but at a measured surface
  void operator+=(const Tally& other) {
    by_current += other.by_current;
    by_kept += other.by_kept;
    at_surfaces += other.at_surfaces;
  }
};

/// Is a candidate left out? It is if it has a normal, lies at no measured surface, and the point `min_gap` behind its centre is known.
Truth closes(const Scene& scene, const Vector3i& v, Tally& tally) {
  const Config& config = scene.camera.config;
  const Vector3d center = scene.grid.center_of(v.x(), v.y(), v.z()), sum = sum_of_directions(scene.grid, scene.observed, v);
  if (less(sum.norm(), 0.01, 1e-4) == Truth::yes) return Truth::no;
  const Vector3d behind = center - config.min_gap * sum.normalized();
  const Truth by_current = camera_knows(scene.current, behind);
  const Truth by_kept = any_knows(scene.kept, scene.current.T_world_camera * behind);
  const Truth surface = at_surface(scene.grid, scene.current.image, scene.layer_depth, config.surface_depth, v, center.z());
  const Truth known = by_current || by_kept;
  tally.by_current += (by_current && !by_kept && !surface) == Truth::yes;
  tally.by_kept += (by_kept && !by_current && !surface) == Truth::yes;
  tally.at_surfaces += (known && surface) == Truth::yes;
  // If the directions nearly cancel, the direction of their sum is too uncertain in float.
  return sum.norm() < 0.1 && !(surface == Truth::yes) ? Truth::open : known && !surface;
}

struct Setup {
  double min_gap;
  int frames;  ///< number of views before the current one
  int recent_views;
  Content content;
  double surface_depth;
};

/// The results of other stages that the stage needs.
struct GapsFixture : FrameFixture {
  explicit GapsFixture(const Config& config)
      : FrameFixture(config),
        space(commands()),
        observed(commands()),
        candidates(commands()),
        list(commands(), lists()),
        settling(commands()) {}

  ObservedSpace space;
  BitField observed;  ///< C~; may differ from the result of `space`
  Candidates candidates;
  CandidateList list;
  ViewSettling settling;
};

/// @param observed_density  density of a random C~; negative: the image's own C~
Scene prepare(CameraSetup camera, const Setup& setup, double observed_density, GapsFixture& fixture, Random& random) {
  Scene scene = {camera, Nuvg(camera.intrinsics, camera.config), {}, {}, {}, {}};
  const Eigen::Isometry3d T_world_start = random.pose(2, 3);
  const double depth_step = depth_step_for(camera.config.z_max);
  for (int frame = 0; frame < setup.frames; ++frame) {
    const SeenView view = {random_image(camera, setup.content, random), T_world_start * random.pose(0.5, 0.6), depth_step};
    fixture.views().set_current(view.image, view.T_world_camera);
    EXPECT_EQ(fixture.views().keep_current(), setup.recent_views > 0);
    if (setup.recent_views > 0) scene.kept.push_back(view);
  }
  scene.current = {random_image(camera, setup.content, random), T_world_start, depth_step};
  fixture.begin(scene.current.image, T_world_start);
  fixture.space.compute(fixture.camera());  // gives the ends of the columns
  scene.observed = observed_density >= 0 ? random_field(fixture.grid(), observed_density, random) : fixture.read(fixture.space.bits());
  fixture.write(fixture.observed, scene.observed);
  scene.layer_depth = fixture.layer_depth();
  return scene;
}

/// @param anywhere  candidates are random unobserved voxels, else the ones of section 3.5
Tally check(CameraSetup camera, const Setup& setup, double observed_density, bool anywhere) {
  SCOPED_TRACE(camera.name + ", gaps of " + std::to_string(setup.min_gap) + " m, " + std::to_string(setup.frames) + " frames, " +
               std::to_string(setup.recent_views) + " views kept, density " + std::to_string(observed_density));
  camera.config.min_gap = setup.min_gap;
  camera.config.recent_views = setup.recent_views;
  camera.config.surface_depth = setup.surface_depth;
  Random random(static_cast<unsigned>(setup.frames));
  GapsFixture fixture(camera.config);
  const Scene scene = prepare(camera, setup, observed_density, fixture, random);
  Field<char> all = anywhere ? random_field(fixture.grid(), 0.5, random) : candidates(scene.observed);
  for_each_voxel(all, [&](int i, int j, int k) { all(i, j, k) = all(i, j, k) && !scene.observed(i, j, k); });
  fixture.write(fixture.candidates, all);

  fixture.settling.settle(fixture.frame(), fixture.camera(), fixture.views(), fixture.seen(), fixture.taken(), fixture.candidates);
  fixture.list_all([&] { fixture.list.list(fixture.frame(), fixture.camera(), fixture.observed, fixture.candidates); },
                   {&fixture.list.voxels()});
  close_thin_gaps(fixture.commands(), fixture.frame(), fixture.camera(), fixture.space.column_end(), fixture.views(),
                  fixture.settling.tile_views(), fixture.taken(), fixture.list, fixture.candidates);
  Tally tally;
  Field<Truth> expected = scene.grid.field(Truth::no);
  for_each_voxel(all, [&](int i, int j, int k) {
    if (!all(i, j, k)) return;
    const Truth settled = any_knows(scene.kept, scene.current.T_world_camera * scene.grid.center_of(i, j, k));
    if (settled == Truth::yes) return;
    expected(i, j, k) = setup.min_gap > 0 ? !settled && !closes(scene, {i, j, k}, tally) : !settled;
  });
  expect_equal("candidates left", expected, fixture.read(fixture.candidates));
  return tally;
}

constexpr double kSurfaceDepth = 0.1;

TEST(StageThinGaps, RandomViews) {
  for (const double min_gap : {0.01, 0.1}) {
    Tally tally;
    for (const CameraSetup& camera : cameras())
      for (const Content content : {Content::mixed, Content::all_valid}) {
        tally += check(camera, {min_gap, 3, 10, content, kSurfaceDepth}, 0.2, true);
        check(camera, {min_gap, 3, 10, content, kSurfaceDepth}, 0.02, true);  // most have no normal
      }
    const std::size_t few = small_tests() ? 0 : 100;
    EXPECT_GT(tally.by_current, few) << "nothing was tested";
    EXPECT_GT(tally.by_kept, few) << "nothing was tested";
    EXPECT_GT(tally.at_surfaces, few) << "nothing was tested";
  }
}

/// More than a group of them, of which each work item of a team has its share.
TEST(StageThinGaps, ManyViews) {
  Tally tally;
  for (const int frames : {17, 40}) tally += check(cameras().front(), {0.1, frames, 50, Content::mixed, kSurfaceDepth}, 0.2, true);
  EXPECT_GT(tally.by_kept, small_tests() ? 0u : 20u) << "nothing was tested";
}

/// The frame's own C~ and the candidates beside it.
TEST(StageThinGaps, CandidatesOfTheFrame) {
  Tally tally;
  for (const CameraSetup& camera : cameras())
    for (const Content content : {Content::mixed, Content::all_valid})
      tally += check(camera, {0.05, 3, 10, content, kSurfaceDepth}, -1, false);
  const std::size_t few = small_tests() ? 0 : 100;
  EXPECT_GT(tally.by_current, few) << "nothing was tested";
  EXPECT_GT(tally.by_kept, few) << "nothing was tested";
  EXPECT_GT(tally.at_surfaces, few) << "nothing was tested";
}

TEST(StageThinGaps, SurfacesOnlyWhereColumnsEnd) {
  std::size_t at_surfaces = 0;
  for (const CameraSetup& camera : cameras()) at_surfaces += check(camera, {0.1, 3, 10, Content::all_valid, 0}, 0.2, true).at_surfaces;
  EXPECT_GT(at_surfaces, small_tests() ? 0u : 50u) << "nothing was tested";
}

TEST(StageThinGaps, NoKeptViews) {
  for (const int recent_views : {0, 10}) {
    const Tally tally =
        check(cameras().front(), {0.1, recent_views == 0 ? 2 : 0, recent_views, Content::all_valid, kSurfaceDepth}, 0.2, true);
    EXPECT_GT(tally.by_current, 20u);
    EXPECT_EQ(tally.by_kept, 0u);
  }
}

TEST(StageThinGaps, NothingIsKnownBehindEmptyViews) {
  const Tally tally = check(cameras().front(), {0.1, 3, 10, Content::all_invalid, kSurfaceDepth}, 0.2, true);
  EXPECT_EQ(tally.by_current + tally.by_kept, 0u);
}

TEST(StageThinGaps, WithoutMinGapAllCandidatesStay) { check(cameras().front(), {0, 3, 10, Content::all_valid, kSurfaceDepth}, 0.2, true); }

}  // namespace
}  // namespace frontier_surfels
