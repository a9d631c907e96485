/// kernels/stages/10_known_hull.cl against the projection of every surfel onto every cell of every face.

#include <gtest/gtest.h>

#include "stages/reference_hull.hpp"
#include "stages/reference_paths.hpp"
#include "stages/stages_probe.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// @param candidate_density  only the paths around so many voxels are needed; 1: all
/// @return share of known cells
double check(const Camera& camera, const Eigen::Isometry3d& T_world_camera, const std::vector<Surfel>& surfels,
             double candidate_density = 1) {
  Random random(1);
  StagesProbe probe(camera.config);
  probe.stages().begin_frame(random_image(camera, Content::all_invalid, random), T_world_camera, 1);
  probe.map().replace(surfels, 1);
  const Nuvg grid(camera.intrinsics, camera.config);
  std::vector<SeenSurfel> seen;
  for (const Surfel& surfel : probe.map().download()) {
    seen.push_back(see(grid, T_world_camera.inverse(), surfel));
    seen.back().ragged = random.chance(0.05);
    if (seen.back().ragged) probe.make_ragged({surfel.id});
  }
  const Field<char> candidates = random_field(probe.grid(), candidate_density, random);
  probe.need_paths_around(candidates);
  probe.stages().compute_known_hull();
  const std::vector<Field<char>> actual = probe.hull(), needed = paths_through(around(candidates, 1));

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
  for (const Camera& camera : cameras()) {
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

/// Walls of surfels that look at the grid from all around: most of its faces are known.
TEST(StageKnownHull, SurroundedByKnownSpace) {
  const Camera camera = cameras().front();
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

/// The same surfels twice, once turned round: unknown wins each tie, so nothing is known.
TEST(StageKnownHull, UnknownWinsTies) {
  const Camera camera = cameras().front();
  Random random(4);
  const Nuvg grid(camera.intrinsics, camera.config);
  std::vector<Surfel> surfels = random_surfels(grid, Eigen::Isometry3d::Identity(), 500, 3, 3, random);
  for (int n = 0; n < 500; ++n) {
    surfels.push_back(surfels[n]);
    surfels.back().normal = -surfels.back().normal;
  }
  StagesProbe probe(camera.config);
  probe.stages().begin_frame(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity(), 1);
  probe.map().replace(surfels, 1);
  probe.need_all_paths();
  probe.stages().compute_known_hull();
  for (const Field<char>& face : probe.hull())
    for (const char state : face.values) EXPECT_FALSE(state);
}

TEST(StageKnownHull, NoSurfels) {
  for (const Camera& camera : cameras()) EXPECT_EQ(check(camera, Eigen::Isometry3d::Identity(), {}), 0);
}

}  // namespace
}  // namespace frontier_surfels
