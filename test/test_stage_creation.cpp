/// The kernels of creation: the filter of new surfels, and their positions and normals.

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "stages/creation.hpp"
#include "stages/frame_fixture.hpp"
#include "stages/reference_observed_space.hpp"
#include "stages/reference_surfels.hpp"
#include "stages/reference_views.hpp"
#include "stages/view_settling.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// The stage of creation, and the results of other stages that it needs.
struct CreationFixture : FrameFixture {
  explicit CreationFixture(const Config& config)
      : FrameFixture(config),
        observed(commands()),
        known(commands()),
        leaving_words(commands()),
        candidates(commands()),
        list(commands(), lists()),
        settling(commands()),
        creation(commands(), lists()) {}

  /// Lists the candidates and filters them. @param with_known  whether the filter uses K~
  void filter(bool with_known = true) {
    list_all(
        [&] {
          list.list(frame(), camera(), observed, candidates);
          creation.filter(frame(), list, candidates, with_known ? &known : nullptr);
        },
        {&list.voxels(), &creation.chosen()});
  }

  /// Voxels of the new surfels, 64 word + bit each.
  std::vector<std::uint32_t> created_voxels() const {
    const std::vector<std::uint32_t> listed = list.voxels().read();
    std::vector<std::uint32_t> voxels;
    for (const std::uint32_t number : creation.chosen().read()) voxels.push_back(listed[number]);
    return voxels;
  }
  Bits created() const {
    std::vector<std::uint64_t> words(Candidates::words(grid()), 0);
    for (const std::uint32_t voxel : created_voxels()) words[voxel / 64] |= std::uint64_t{1} << voxel % 64;
    return read_tile_words(words);
  }

  /// No surfel leaves the map.
  const BitField& leaving() {
    leaving_words.write(std::vector<cl_ulong>(map().window_pages() + 1, 0));
    return leaving_words;
  }

  BitField observed, known, leaving_words;
  Candidates candidates;
  CandidateList list;
  ViewSettling settling;
  Creation creation;
};

/// @param all_views  as if no view was forgotten: K~ is not computed, and the filter does not use it
void check_filter(const CameraSetup& camera, double observed_density, double known_density, bool all_views = false) {
  SCOPED_TRACE(camera.name + ", density " + std::to_string(observed_density));
  Random random(1);
  const Nuvg grid(camera.intrinsics, camera.config);
  CreationFixture fixture(camera.config);
  fixture.begin(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
  const Field<char> observed = random_field(fixture.grid(), observed_density, random);
  const Field<char> known = random_field(fixture.grid(), known_density, random);
  Field<char> candidates = random_field(fixture.grid(), 0.5, random);
  for_each_voxel(candidates, [&](int i, int j, int k) { candidates(i, j, k) = candidates(i, j, k) && !observed(i, j, k); });
  fixture.write(fixture.observed, observed);
  fixture.write(fixture.known, known);
  fixture.write(fixture.candidates, candidates);
  fixture.filter(!all_views);
  Field<Truth> expected = grid.field(Truth::no);
  for_each_voxel(candidates, [&](int i, int j, int k) {
    if (!candidates(i, j, k) || (known(i, j, k) && !all_views)) return;
    expected(i, j, k) = !less(sum_of_directions(grid, observed, Vector3i(i, j, k)).norm(), 0.01, 1e-4);
  });
  expect_equal("candidates left", expected, fixture.created());
  const std::vector<std::uint32_t> voxels = fixture.created_voxels();
  EXPECT_TRUE(std::is_sorted(voxels.begin(), voxels.end()));
}

TEST(StageCreation, FilterOfRandomCandidates) {
  for (const CameraSetup& camera : cameras())
    for (const double density : {0.03, 0.5}) check_filter(camera, density, 0.3);
}

TEST(StageCreation, FilterWithNothingObservedOrAllKnown) {
  const CameraSetup camera = cameras().front();
  check_filter(camera, 0, 0);
  check_filter(camera, 0.5, 0);
  check_filter(camera, 0.5, 1);
}

TEST(StageCreation, FilterWhileNoViewIsForgotten) {
  for (const CameraSetup& camera : cameras()) check_filter(camera, 0.3, 0.5, true);
}

/// The directions to two observed voxels on opposite sides cancel; a third voxel gives the normal.
TEST(StageCreation, OppositeDirectionsMakeNoSurfel) {
  const CameraSetup camera = cameras().front();
  Random random(1);
  CreationFixture fixture(camera.config);
  fixture.begin(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
  Field<char> observed(fixture.grid(), 0), candidates(fixture.grid(), 0);
  observed(3, 4, 5) = observed(5, 4, 5) = 1;  // in the cuboid, where opposite directions cancel exactly
  observed(9, 4, 5) = observed(11, 4, 5) = observed(10, 5, 5) = 1;
  candidates(4, 4, 5) = candidates(10, 4, 5) = 1;
  fixture.write(fixture.observed, observed);
  fixture.write(fixture.known, Field<char>(fixture.grid(), 0));
  fixture.write(fixture.candidates, candidates);
  fixture.filter();
  candidates(4, 4, 5) = 0;
  expect_equal("candidates left", candidates, fixture.created());
}

struct Scene {
  CameraSetup camera;
  Nuvg grid;
  std::vector<SeenView> kept;
  SeenView current;
  Field<char> observed;
  std::vector<Vector3i> voxels;  ///< voxels of the candidates, in the order of their numbers
};

/// Distance from a new surfel to the point in front of it that should be known: 7/4 r [m].
double front_distance(const Scene& scene, const Vector3d& center) { return 1.75 * std::sqrt(3.0) / 2 * scene.grid.voxel_size(center.z()); }

Truth current_view_knows(const Scene& scene, const Vector3d& p_camera) { return camera_knows(scene.current, p_camera); }

/// Predicate for a point that is known up to an error of `off` [m] along each axis; open if the predicate differs nearby.
template <typename Predicate>
Truth about(const Vector3d& p, double off, Predicate&& predicate) {
  const Truth here = predicate(p);
  for (int corner = 0; corner < 8; ++corner)
    if (predicate(p + off * Vector3d(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1)) != here) return Truth::open;
  return here;
}

/// Does the current view know the point in front of a new surfel with this normal?
Truth has_known_front(const Scene& scene, const Vector3i& v, const Vector3d& normal) {
  const Vector3d center = scene.grid.center_of(v.x(), v.y(), v.z());
  return current_view_knows(scene, center + front_distance(scene, center) * normal);
}

/// Is this a valid normal? It should be the mean direction. If the current view does not know the point in front for that, it should be the
/// direction to a single observed voxel for which the point is known, the nearest such direction to the mean.
bool is_normal(const Scene& scene, const Vector3i& v, const Vector3d& normal) {
  constexpr double kTolerance = 1e-3;
  const std::vector<Vector3d> all = directions(scene.grid, scene.observed, v);
  const Vector3d mean = sum_of_directions(scene.grid, scene.observed, v).normalized();
  const auto has_front = [&](const Vector3d& n) { return has_known_front(scene, v, n); };
  double certain = -2;  // cosine between the mean and the nearest direction that certainly has a known point in front
  for (const Vector3d& direction : all)
    if (has_front(direction) == Truth::yes && direction.dot(mean) > -1 + 1e-5)  // the opposite of the mean is never chosen
      certain = std::max(certain, direction.dot(mean));
  if ((normal - mean).norm() < kTolerance && (has_front(mean) != Truth::no || certain < -1)) return true;
  if (has_front(mean) == Truth::yes) return false;
  for (const Vector3d& direction : all)
    if ((normal - direction).norm() < kTolerance && has_front(direction) != Truth::no && direction.dot(mean) > certain - kTolerance)
      return true;
  return false;
}

/// Expects that a new surfel stands in its voxel, was moved only towards known space, and does not stand in known space.
/// @return distance by which it was moved [voxel]
double check_place(const Scene& scene, const Vector3i& v, const Vector3d& normal, const Vector3d& p) {
  const Vector3d center = scene.grid.center_of(v.x(), v.y(), v.z()), moved = p - center;
  const Voxel voxel = voxel_of(scene.grid.to_grid(p), 1e-3);
  EXPECT_TRUE(voxel.open || voxel.index == v) << "not in its voxel";
  const double size = scene.grid.voxel_size(center.z());
  EXPECT_GE(moved.dot(normal), -1e-3 * size) << "moved away from the boundary";
  EXPECT_LT((moved - moved.dot(normal) * normal).norm(), 1e-3 * size) << "moved sideways";

  const auto known = [&](const Vector3d& q) {
    return current_view_knows(scene, q) || any_knows(scene.kept, scene.current.T_world_camera * q);
  };
  const double step = 2 * position_step(scene.camera.config);  // in any direction
  if (known(center) == Truth::no) {
    EXPECT_TRUE(about(p, step, known) != Truth::yes) << "moved into known space";
  }
  const Vector3d front = front_distance(scene, center) * normal;
  const double off = step + 1e-4 * front.norm();  // error of the position, and of the normal
  const auto seen = [&](const Vector3d& q) { return current_view_knows(scene, q); };
  if (about(center + front, off, seen) == Truth::yes) {
    EXPECT_TRUE(about(p + front, off, seen) != Truth::no) << "the point in front is no longer known";
  }
  return moved.norm() / size;
}

Scene prepare(const CameraSetup& camera, CreationFixture& fixture, double density, Random& random) {
  Scene scene = {camera, Nuvg(camera.intrinsics, camera.config), {}, {}, {}, {}};
  const Eigen::Isometry3d T_world_start = random.pose(2, 3);
  const double depth_step = depth_step_for(camera.config.z_max);
  for (int frame = 0; frame < 3; ++frame) {
    scene.kept.push_back({random_image(camera, Content::mixed, random), T_world_start * random.pose(0.3, 0.4), depth_step});
    fixture.views().set_current(scene.kept.back().image, scene.kept.back().T_world_camera);
    EXPECT_TRUE(fixture.views().keep_current());
  }
  scene.current = {random_image(camera, Content::all_valid, random), T_world_start, depth_step};
  fixture.begin(scene.current.image, T_world_start);
  scene.observed = random_field(fixture.grid(), 0.2, random);
  Field<char> candidates = random_field(fixture.grid(), density, random);
  for_each_voxel(candidates, [&](int i, int j, int k) {
    if (scene.observed(i, j, k) || sum_of_directions(scene.grid, scene.observed, Vector3i(i, j, k)).norm() < 0.05) candidates(i, j, k) = 0;
  });
  fixture.write(fixture.observed, scene.observed);
  fixture.write(fixture.candidates, candidates);
  fixture.settling.settle(fixture.frame(), fixture.camera(), fixture.views(), fixture.seen(), fixture.taken(), fixture.candidates);
  fixture.write(fixture.known, Field<char>(fixture.grid(), 0));
  fixture.filter();
  candidates = fixture.created();
  const int words_k = (scene.grid.size_k + 63) / 64;
  for (int tile_j = 0; tile_j < scene.grid.size_j; tile_j += VIEW_TILE)
    for (int w = 0; w < words_k; ++w)
      for (int tile_i = 0; tile_i < scene.grid.size_i; tile_i += VIEW_TILE)
        for (int j = tile_j; j < std::min(tile_j + VIEW_TILE, scene.grid.size_j); ++j)
          for (int i = tile_i; i < std::min(tile_i + VIEW_TILE, scene.grid.size_i); ++i)
            for (int k = 64 * w; k < std::min(64 * (w + 1), scene.grid.size_k); ++k)
              if (candidates(i, j, k)) scene.voxels.emplace_back(i, j, k);
  return scene;
}

/// Expects a valid new surfel in voxel v. @return distance by which it was moved from the voxel's centre [voxel]
double check_new_surfel(const Scene& scene, const Vector3i& v, const Surfel& surfel, std::uint32_t attributes) {
  const bool refine = scene.camera.config.refine_surfels;
  const Eigen::Isometry3d T_camera_world = scene.current.T_world_camera.inverse();
  const Vector3d normal = T_camera_world.linear() * surfel.normal.cast<double>(), p = T_camera_world * surfel.position.cast<double>();
  const Vector3d mean = sum_of_directions(scene.grid, scene.observed, v).normalized();
  const Truth ragged = refine ? !has_known_front(scene, v, mean) : Truth::no;
  if (refine)
    EXPECT_TRUE(is_normal(scene, v, normal)) << "normal " << normal.transpose();
  else
    EXPECT_LT((normal - mean).norm(), 1e-4) << "normal " << normal.transpose();
  if (ragged != Truth::open) {
    EXPECT_EQ(attributes, ragged == Truth::yes ? SURFEL_RAGGED : 0);
  }
  const double size = scene.grid.voxel_size(scene.grid.center_of(v.x(), v.y(), v.z()).z());
  EXPECT_NEAR(surfel.radius, std::sqrt(3.0) / 2 * size, size / 2048) << "more than the rounding to 16 bits";
  EXPECT_EQ(surfel.label, Label::kFrontier);
  EXPECT_TRUE((surfel.rgb == std::array<std::uint8_t, 3>{0, 0, 0}));
  return check_place(scene, v, normal, p);
}

/// @return number of new surfels that were moved
std::size_t check_creation(CameraSetup camera, int old_surfels, double density, bool refine = true) {
  SCOPED_TRACE(camera.name + ", " + std::to_string(old_surfels) + " old surfels, density " + std::to_string(density));
  camera.config.refine_surfels = refine;
  Random random(2);
  CreationFixture fixture(camera.config);
  const Nuvg grid(camera.intrinsics, camera.config);
  fixture.map().replace(random_surfels(grid, Eigen::Isometry3d::Identity(), old_surfels, 2, 2, random), 1);
  if (old_surfels > 10) fixture.access().kill(some_slots(fixture.map().download(), 7));
  const Scene scene = prepare(camera, fixture, density, random);
  fixture.map().reserve(fixture.creation.chosen().count());
  const std::vector<Surfel> there = fixture.map().download();
  const std::size_t before = fixture.map().size();
  std::set<std::uint32_t> old_slots;
  for (const Surfel& surfel : there) old_slots.insert(surfel.id);
  EXPECT_EQ(old_slots.size(), before);

  EXPECT_EQ(fixture.creation.chosen().count(), scene.voxels.size());
  fixture.creation.create(fixture.frame(), fixture.camera(), fixture.views(), fixture.seen(), fixture.taken(), fixture.settling,
                          fixture.list, fixture.leaving(), fixture.map());
  fixture.commands().wait();
  fixture.creation.insert(fixture.map());
  EXPECT_EQ(fixture.map().size(), before + scene.voxels.size());
  const std::size_t count = scene.voxels.size();
  const std::vector<std::uint32_t> slots = fixture.access().find_slots(fixture.creation.new_surfels().surfels.read(count),
                                                                       fixture.creation.new_surfels().cells.read(count), old_slots);
  std::map<std::uint32_t, Surfel> by_slot;
  for (const Surfel& surfel : fixture.finish(5).updated) by_slot[surfel.id] = surfel;
  EXPECT_EQ(by_slot.size(), scene.voxels.size());

  std::size_t moved = 0;
  for (std::size_t n = 0; n < scene.voxels.size(); ++n) {
    const Vector3i v = scene.voxels[n];
    SCOPED_TRACE(voxel_text(v.x(), v.y(), v.z()));
    moved += check_new_surfel(scene, v, by_slot.at(slots[n]), fixture.access().attributes(slots[n])) > 1e-3;
  }
  return moved;
}

TEST(StageCreation, RandomCandidates) {
  std::size_t moved = 0;
  for (const CameraSetup& camera : cameras()) moved += check_creation(camera, 0, 0.01);
  EXPECT_TRUE(moved > 50 || small_tests()) << "nothing was moved";
  EXPECT_GT(moved, 0u);
}

TEST(StageCreation, AtVoxelCentersWithoutRefinement) {
  for (const CameraSetup& camera : cameras()) EXPECT_EQ(check_creation(camera, 0, 0.01, false), 0u);
}

TEST(StageCreation, FreeSlotsFirst) { check_creation(cameras().front(), 20, 0.05); }

TEST(StageCreation, NoCandidates) { check_creation(cameras().front(), 20, 0); }

TEST(StageCreation, MoreSurfelsThanTheMapHasRoomFor) {
  const CameraSetup camera = small_tests() ? cameras().front() : make_camera(40, 30, 39.1, 37.3, 127);
  check_creation(camera, 0, 1);
}

}  // namespace
}  // namespace frontier_surfels
