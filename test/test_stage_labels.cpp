/// The kernels of labels and colours compared with the columns of observed space, one surfel at a time.

#include <gtest/gtest.h>

#include <map>

#include "stages/reference_observed_space.hpp"
#include "stages/reference_surfels.hpp"
#include "stages/removal.hpp"
#include "stages/visit_fixture.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

struct Scene {
  CameraSetup camera;
  Nuvg grid;
  WorkingImage image;
  Eigen::Isometry3d T_world_camera;
};

/// Surfels, most of them near the ends of columns.
std::vector<Surfel> surfels_near_surfaces(const Scene& scene, int count, Random& random) {
  std::vector<Surfel> surfels = random_surfels(scene.grid, scene.T_world_camera, count, 2, 2, random);
  for (Surfel& surfel : surfels) {
    if (random.chance(0.2)) continue;
    const int s = random.whole(-1, scene.camera.intrinsics.width), t = random.whole(-1, scene.camera.intrinsics.height);
    const bool inside = s >= 0 && t >= 0 && s < scene.camera.intrinsics.width && t < scene.camera.intrinsics.height;
    const double d = inside ? std::abs(scene.image.depth[t * scene.camera.intrinsics.width + s]) : 1;
    const double layer = d > 0 ? scene.grid.to_grid({0, 0, d}).z() : random.uniform(0, scene.grid.size_k);
    const Vector3d c(s + scene.grid.padding_i + random.uniform(-0.5, 0.5), t + scene.grid.padding_j + random.uniform(-0.5, 0.5),
                     layer + random.uniform(-2, 3));
    surfel.position = (scene.T_world_camera * scene.grid.from_grid(c)).cast<float>();
  }
  return surfels;
}

/// @param pixel  out: index of the pixel whose column contains the surfel
Truth is_at_surface(const Scene& scene, const std::vector<float>& layer_depth, const Surfel& surfel, int* pixel) {
  const Vector3d p = scene.T_world_camera.inverse() * surfel.position.cast<double>();
  const Voxel voxel = voxel_of(scene.grid.to_grid(p), 1e-3);
  const int s = voxel.index.x() - scene.grid.padding_i, t = voxel.index.y() - scene.grid.padding_j;
  *pixel = t * scene.camera.intrinsics.width + s;
  if (voxel.open) return Truth::open;
  return at_surface(scene.grid, scene.image, layer_depth, scene.camera.config.surface_depth, voxel.index, p.z());
}

/// @param removed  number of surfels of `before` that were removed
/// @param are_new  all surfels count as changed, whether they get a label or not
/// @return number of surfels at surfaces
std::size_t compare(const Scene& scene, VisitFixture& fixture, const std::vector<Surfel>& before, std::size_t removed, bool are_new) {
  std::map<std::uint32_t, Surfel> after, changed;
  for (const Surfel& surfel : fixture.map().download()) after[surfel.id] = surfel;
  for (const Surfel& surfel : fixture.finish(4).updated) changed[surfel.id] = surfel;
  EXPECT_EQ(after.size() + removed, before.size());
  const std::vector<float> layer_depth = fixture.layer_depth();
  Comparison occupied("occupied"), colored("colour taken"), told("change reported");
  std::size_t at_surfaces = 0;
  for (const Surfel& surfel : before) {
    if (after.count(surfel.id) == 0) continue;  // in observed space
    const auto place = [&] { return "surfel " + std::to_string(surfel.id); };
    int pixel;
    const Truth at_surface = is_at_surface(scene, layer_depth, surfel, &pixel);
    const bool was_occupied = surfel.label == Label::kOccupied, was_colored = surfel.rgb != std::array<std::uint8_t, 3>{0, 0, 0};
    const Surfel& actual = after.at(surfel.id);
    const Truth takes_color = at_surface && truth(!was_colored && !scene.image.color.empty());
    occupied.add(truth(was_occupied) || at_surface, actual.label == Label::kOccupied, place);
    colored.add(takes_color, actual.rgb != surfel.rgb, place);
    told.add(truth(are_new) || takes_color || (at_surface && truth(!was_occupied)), changed.count(surfel.id) > 0, place);
    EXPECT_TRUE(actual.position == surfel.position && actual.normal == surfel.normal && actual.radius == surfel.radius) << place();
    at_surfaces += at_surface == Truth::yes;
    if (takes_color != Truth::yes) continue;
    const std::uint32_t rgb = scene.image.color[pixel];
    for (int channel = 0; channel < 3; ++channel) EXPECT_EQ(actual.rgb[channel], rgb >> (8 * channel) & 0xff) << place();
  }
  return at_surfaces;
}

std::size_t check(CameraSetup camera, Content content, int count, bool with_color, double surface_depth, bool are_new) {
  SCOPED_TRACE(camera.name + ", " + std::to_string(count) + " surfels" + (with_color ? ", colour" : "") + (are_new ? ", new" : "") +
               ", surface depth " + std::to_string(surface_depth));
  camera.config.surface_depth = surface_depth;
  camera.config.remove_buried = false;
  camera.config.min_gap = 0;
  Random random(static_cast<unsigned>(count));
  Scene scene = {camera, Nuvg(camera.intrinsics, camera.config), random_image(camera, content, random), random.pose(2, 3)};
  if (with_color)
    for (std::size_t pixel = 0; pixel < scene.image.depth.size(); ++pixel) scene.image.color.push_back((random.bits() & 0xffffff) | 1);
  VisitFixture fixture(camera.config);
  const std::vector<std::uint32_t> slots = fixture.map().replace(surfels_near_surfaces(scene, count, random), 1);
  if (count > 10) fixture.access().kill({slots[1], slots[8], slots[9]});
  const std::vector<Surfel> before = fixture.map().download();
  fixture.begin_and_observe(scene.image, scene.T_world_camera);
  std::size_t removed = 0;
  if (are_new) {
    fixture.access().change_all();
  } else {
    removed = fixture.look().removed;  // also marks the remaining surfels that get a label
    remove_surfels(fixture.commands(), fixture.visit.removed(), removed, fixture.map());
  }
  label_surfels(fixture.commands(), fixture.frame(), fixture.camera(), fixture.space.column_end(), fixture.map());
  return compare(scene, fixture, before, removed, are_new);
}

TEST(StageLabels, RandomSurfels) {
  std::size_t at_surfaces = 0;
  for (const CameraSetup& camera : cameras())
    for (const bool with_color : {false, true})
      for (const bool are_new : {false, true}) {
        const int count = small_tests() ? 200 : 1500;
        check(camera, Content::mixed, count, with_color, 0.03, are_new);
        at_surfaces += check(camera, Content::all_valid, count, with_color, 0.03, are_new);
        EXPECT_EQ(check(camera, Content::all_invalid, count, with_color, 0.03, are_new), 0u);
      }
  EXPECT_GT(at_surfaces, small_tests() ? 5u : 50u) << "nothing was tested";
}

TEST(StageLabels, OnlyWhereColumnsEnd) {
  for (const CameraSetup& camera : cameras()) check(camera, Content::mixed, 500, true, 0, false);
}

TEST(StageLabels, NumbersOfSurfels) {
  for (const int count : {0, 1, 63, 64, 65})
    for (const bool are_new : {false, true}) check(cameras().front(), Content::all_valid, count, true, 0.03, are_new);
}

}  // namespace
}  // namespace frontier_surfels
