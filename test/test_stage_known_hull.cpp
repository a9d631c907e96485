/// kernels/stages/12_known_hull.cl compared with the projection of every surfel onto every cell of every face.

#include <gtest/gtest.h>

#include "stages/known_hull.hpp"
#include "stages/path_fields.hpp"
#include "stages/reference_hull.hpp"
#include "stages/reference_paths.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// @param candidate_density  share of candidate voxels; only the paths around these are needed
/// @return share of known cells
double check(const CameraSetup& camera, const Eigen::Isometry3d& T_world_camera, const std::vector<Surfel>& surfels,
             double candidate_density = 1) {
  Random random(1);
  FrameFixture fixture(camera.config);
  fixture.begin(random_image(camera, Content::all_invalid, random), T_world_camera);
  fixture.map().replace(surfels, 1);
  const Nuvg grid(camera.intrinsics, camera.config);
  std::vector<SeenSurfel> seen;
  for (const Surfel& surfel : fixture.map().download()) {
    seen.push_back(see(grid, T_world_camera.inverse(), surfel));
    seen.back().ragged = random.chance(0.05);
    if (seen.back().ragged) fixture.access().make_ragged({surfel.id});
  }
  const Field<char> candidates = random_field(fixture.grid(), candidate_density, random);
  Candidates candidate_bits(fixture.commands());
  NeededPaths paths(fixture.commands());
  need_paths_around(fixture, candidates, candidate_bits, paths);
  KnownHull hull(fixture.commands());
  hull.compute(fixture.frame(), paths, fixture.map());
  const std::vector<Field<char>> actual = read_hull(fixture.grid(), hull.states()), needed = paths_through(around(candidates, 1));

  constexpr double kUnknownScale = 1.5;
  const Hull expected(grid, camera.config.th_d, kUnknownScale, seen);
  double known = 0, cells = 0;
  for (int face = FACE_I_LOW; face <= FACE_K_HIGH; ++face) {
    Comparison comparison("face " + std::to_string(face));
    for_each_voxel(actual[face], [&](int row, int, int column) {
      if (!needed[face / 2](row, 0, column)) return;
      comparison.add(expected.face(face)(row, 0, column), actual[face](row, 0, column),
                     [=] { return "row " + std::to_string(row) + ", column " + std::to_string(column); });
      known += actual[face](row, 0, column);
      ++cells;
    });
  }
  return known / std::max(cells, 1.0);
}

TEST(StageKnownHull, RandomSurfels) {
  double known = 0;
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Random random(2);
    const Nuvg grid(camera.intrinsics, camera.config);
    const Eigen::Isometry3d T_world_camera = random.pose(2, 3);
    const int cells = (grid.size_i + grid.size_j) * grid.size_k + grid.size_i * grid.size_j;
    const std::vector<Surfel> surfels = random_surfels(grid, T_world_camera, cells / 20, 4, 3, random);
    known = std::max(known, check(camera, T_world_camera, surfels));
    check(camera, T_world_camera, surfels, 0.002);
  }
  EXPECT_GT(known, 0.005) << "nothing was tested";
}

/// Surfels all around the grid face its middle, so that most of its faces are known.
TEST(StageKnownHull, SurroundedByKnownSpace) {
  const CameraSetup camera = cameras().front();
  Random random(7);
  const Nuvg grid(camera.intrinsics, camera.config);
  const Eigen::Isometry3d T_world_camera = random.pose(2, 3);
  const Vector3d middle = grid.from_grid(Vector3d(grid.size_i, grid.size_j, grid.size_k) / 2);
  std::vector<Surfel> surfels = random_surfels(grid, T_world_camera, 4000, 2, 2, random);
  for (Surfel& surfel : surfels) {
    surfel.normal = (T_world_camera * middle - surfel.position.cast<double>()).normalized().cast<float>();
    if (random.chance(0.01)) surfel.normal = -surfel.normal;
  }
  EXPECT_GT(check(camera, T_world_camera, surfels), 0.3);
  EXPECT_GT(check(camera, T_world_camera, surfels, 0.005), 0.3);
}

/// Every surfel has a twin that faces the other way. Unknown wins each tie, so nothing is known.
TEST(StageKnownHull, UnknownWinsTies) {
  const CameraSetup camera = cameras().front();
  Random random(4);
  const Nuvg grid(camera.intrinsics, camera.config);
  std::vector<Surfel> surfels = random_surfels(grid, Eigen::Isometry3d::Identity(), 500, 3, 3, random);
  for (int n = 0; n < 500; ++n) {
    surfels.push_back(surfels[n]);
    surfels.back().normal = -surfels.back().normal;
  }
  FrameFixture fixture(camera.config);
  fixture.begin(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
  fixture.map().replace(surfels, 1);
  Candidates candidates(fixture.commands());
  NeededPaths paths(fixture.commands());
  need_paths_around(fixture, Field<char>(fixture.grid(), 1), candidates, paths);
  KnownHull hull(fixture.commands());
  hull.compute(fixture.frame(), paths, fixture.map());
  for (const Field<char>& face : read_hull(fixture.grid(), hull.states()))
    for (const char state : face.values) EXPECT_FALSE(state);
}

TEST(StageKnownHull, NoSurfels) {
  for (const CameraSetup& camera : cameras()) EXPECT_EQ(check(camera, Eigen::Isometry3d::Identity(), {}), 0);
}

}  // namespace
}  // namespace frontier_surfels
