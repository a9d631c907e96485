/// What points that were taken back change in other stages: settling by views, thin gaps, creation, and the visit of surfels.

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "stages/creation.hpp"
#include "stages/lattice_input.hpp"
#include "stages/reference_observed_space.hpp"
#include "stages/reference_surfels.hpp"
#include "stages/reference_views.hpp"
#include "stages/thin_gaps.hpp"
#include "stages/view_settling.hpp"
#include "stages/visit_fixture.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// A frame with kept views, seen points and taken points, all of them random.
struct Scene {
  CameraSetup camera;
  Nuvg grid;
  VisitFixture fixture;
  Random random;
  SeenView now;
  std::vector<SeenView> kept;
  Frame frame = {};
  CandidateList list;
  ViewSettling settling;

  Scene(const CameraSetup& with_camera, unsigned seed)
      : camera(with_camera),
        grid(camera.intrinsics, camera.config),
        fixture(camera.config),
        random(seed),
        list(fixture.commands(), fixture.lists()),
        settling(fixture.commands()) {}

  /// @param full  shares of the lattices' bricks that are full; negative: there are no such points at all
  void begin(int views, double full_seen, double full_taken, Content content = Content::mixed) {
    const Eigen::Isometry3d T_world_start = random.pose(2, 3);
    const double depth_step = depth_step_for(camera.config.z_max);
    for (int n = 0; n < views; ++n) {
      kept.push_back({random_image(camera, content, random), T_world_start * random.pose(0.4, 0.5), depth_step});
      fixture.views().set_current(kept.back().image, kept.back().T_world_camera);
      EXPECT_TRUE(fixture.views().keep_current());
    }
    now = {random_image(camera, content, random), T_world_start, depth_step};
    fixture.seen().choose_spacing(camera.config.z_max / 40);
    fixture.taken().choose_spacing(camera.config.z_max / 40);
    fixture.begin_and_observe(now.image, now.T_world_camera);
    if (full_seen >= 0) fill_lattice(fixture.seen(), fixture.map().window(), full_seen, 0.2, random);
    if (full_taken >= 0) fill_lattice(fixture.taken(), fixture.map().window(), full_taken, 0.2, random);
    fixture.seen().open_window(fixture.map().window());
    fixture.taken().open_window(fixture.map().window());
    frame = make_frame(fixture.camera(), fixture.map().window(), fixture.views(), &fixture.seen(), fixture.limits());
    frame.has_taken = frame.takes_back = full_taken >= 0 ? 1 : 0;
  }

  void settle(Candidates& candidates) {
    settling.settle(frame, fixture.camera(), fixture.views(), fixture.seen(), fixture.taken(), candidates);
  }
  void list_candidates() {
    fixture.list_all([this] { list.list(frame, fixture.camera(), fixture.observed, fixture.candidates); }, {&list.voxels()});
  }
  SeenBits seen_bits() { return bits_in_window(fixture.seen(), fixture.map().window()); }
  SeenBits taken_bits() { return bits_in_window(fixture.taken(), fixture.map().window()); }
  Vector3d to_world(const Vector3d& p_camera) const { return now.T_world_camera * p_camera; }
};

/// Candidates that views or seen points know go, but stay where space was taken back.
void check_settling(const CameraSetup& camera, int views, double full_seen, double full_taken, double density, std::size_t& stay,
                    std::size_t& go) {
  SCOPED_TRACE(camera.name + ", " + std::to_string(views) + " views, seen " + std::to_string(full_seen) + ", taken " +
               std::to_string(full_taken) + ", density " + std::to_string(density));
  Scene scene(camera, 1);
  scene.begin(views, full_seen, full_taken);
  Candidates left(scene.fixture.commands());
  const Field<char> candidates = random_field(scene.fixture.grid(), density, scene.random);
  scene.fixture.write(left, candidates);
  scene.settle(left);
  const SeenBits seen = scene.seen_bits(), taken = scene.taken_bits();
  Field<Truth> expected = scene.grid.field(Truth::no);
  for_each_voxel(candidates, [&](int i, int j, int k) {
    if (!candidates(i, j, k)) return;
    const Vector3d p = scene.to_world(scene.grid.center_of(i, j, k));
    const Truth known = any_knows(scene.kept, p) || is_among(seen, p), is_taken = is_among(taken, p);
    expected(i, j, k) = is_taken || !known;
    stay += (known && is_taken) == Truth::yes;
    go += (known && !is_taken) == Truth::yes;
  });
  expect_equal("candidates left", expected, scene.fixture.read(left));
}

TEST(StageTakenPoints, TakenCandidatesAreNotSettled) {
  std::size_t stay = 0, go = 0;
  for (const CameraSetup& camera : cameras())
    for (const double density : {0.002, 0.3})
      for (const double full_taken : {0.05, 0.4}) {
        check_settling(camera, 4, -1, full_taken, density, stay, go);
        check_settling(camera, 20, 0.3, full_taken, density, stay, go);
        check_settling(camera, 0, 0.5, full_taken, density, stay, go);
      }
  EXPECT_GT(stay, small_tests() ? 10u : 1000u) << "nothing was tested";
  EXPECT_GT(go, small_tests() ? 10u : 1000u) << "nothing was tested";
}

TEST(StageTakenPoints, AllOrNothingTaken) {
  std::size_t go = 0, none = 0;
  for (const CameraSetup& camera : cameras()) check_settling(camera, 4, 0.5, -1, 0.3, none, go);
  EXPECT_EQ(none, 0u);
  const CameraSetup camera = cameras().front();
  Scene scene(camera, 2);
  scene.begin(4, 1, -1);
  SeenBlockBytes all;
  for (int brick = 0; brick < scene.fixture.taken().bricks_of_block(); ++brick) all.add_uniform(SEEN_ALL);
  std::vector<SeenBlock> blocks;
  const std::vector<std::uint8_t> bytes = all.take();
  for (int cell = 0; cell < scene.fixture.map().window().cells(); ++cell)
    blocks.push_back({scene.fixture.map().window().block(cell), bytes});
  scene.fixture.taken().add_blocks(blocks);
  scene.fixture.taken().open_window(scene.fixture.map().window());
  scene.frame.has_taken = 1;
  Candidates left(scene.fixture.commands());
  const Field<char> candidates = random_field(scene.fixture.grid(), 0.5, scene.random);
  scene.fixture.write(left, candidates);
  scene.settle(left);
  expect_equal("candidates left", candidates, scene.fixture.read(left));
}

/// Kept views do not count for a candidate that is taken, or if the point min_gap behind it is: only this frame does.
TEST(StageTakenPoints, KeptViewsCloseNoGapAtTakenCandidates) {
  std::size_t closed = 0, stay = 0, by_now = 0;
  for (CameraSetup camera : cameras())
    for (const double full_taken : {0.05, 0.4}) {
      SCOPED_TRACE(camera.name + ", taken " + std::to_string(full_taken));
      camera.config.min_gap = 0.1;
      camera.config.surface_depth = 0;
      Scene scene(camera, 3);
      scene.begin(5, -1, full_taken);
      VisitFixture& fixture = scene.fixture;
      const Field<char> observed = random_field(fixture.grid(), 0.2, scene.random);
      Field<char> all = random_field(fixture.grid(), 0.5, scene.random);
      for_each_voxel(all, [&](int i, int j, int k) { all(i, j, k) = all(i, j, k) && !observed(i, j, k); });
      fixture.write(fixture.observed, observed);
      fixture.write(fixture.candidates, all);
      scene.settle(fixture.candidates);
      scene.list_candidates();
      close_thin_gaps(fixture.commands(), scene.frame, fixture.camera(), fixture.space.column_end(), fixture.views(),
                      scene.settling.tile_views(), fixture.taken(), scene.list, fixture.candidates);
      const SeenBits taken = scene.taken_bits();
      const std::vector<float> layer_depth = fixture.layer_depth();
      Field<Truth> expected = scene.grid.field(Truth::no);
      for_each_voxel(all, [&](int i, int j, int k) {
        if (!all(i, j, k)) return;
        const Vector3d center = scene.grid.center_of(i, j, k), sum = sum_of_directions(scene.grid, observed, {i, j, k});
        const Truth is_taken = is_among(taken, scene.to_world(center));
        const Truth left = is_taken || !any_knows(scene.kept, scene.to_world(center));
        if (left == Truth::no) return;
        const Vector3d behind = center - camera.config.min_gap * sum.normalized();
        const Truth now = camera_knows(scene.now, behind), kept = any_knows(scene.kept, scene.to_world(behind));
        const Truth open = !at_surface(scene.grid, scene.now.image, layer_depth, 0, {i, j, k}, center.z());
        const Truth is_behind_taken = is_taken || is_among(taken, scene.to_world(behind));
        const Truth closes = open && (now || (kept && !is_behind_taken));
        if (sum.norm() < 0.01 - 1e-4)
          expected(i, j, k) = left;  // no normal
        else if (sum.norm() < 0.1)
          expected(i, j, k) = open == Truth::no ? left : Truth::open;  // the normal is too uncertain in float
        else
          expected(i, j, k) = left && !closes;
        if (sum.norm() < 0.1 || open != Truth::yes) return;
        closed += (left && !now && kept && !is_behind_taken) == Truth::yes;
        stay += (!now && kept && is_taken) == Truth::yes;
        by_now += (now && is_taken) == Truth::yes;
      });
      expect_equal("candidates left", expected, fixture.read(fixture.candidates));
    }
  for (const std::size_t count : {closed, stay, by_now}) EXPECT_GT(count, small_tests() ? 0u : 100u) << "nothing was tested";
}

/// Packed new surfels and their cells of the window, by the numbers of their candidates.
using Created = std::map<std::uint32_t, std::array<std::uint32_t, 5>>;

/// @param views     whether there are kept views and seen points. @param taken  whether taken points count
/// @param is_taken  gets whether each candidate is at taken points; may be null
Created created_with(const CameraSetup& camera, bool views, bool taken, std::map<std::uint32_t, Truth>* is_taken) {
  Scene scene(camera, 4);
  scene.begin(4, 0.1, 0.4);
  VisitFixture& fixture = scene.fixture;
  const Field<char> observed = random_field(fixture.grid(), 0.2, scene.random);
  Field<char> candidates = random_field(fixture.grid(), 0.1, scene.random);
  for_each_voxel(candidates, [&](int i, int j, int k) {
    if (observed(i, j, k) || sum_of_directions(scene.grid, observed, Vector3i(i, j, k)).norm() < 0.05) candidates(i, j, k) = 0;
  });
  const SeenBits taken_bits = scene.taken_bits();
  if (!views) {
    fixture.views().clear(false);
    fixture.seen().clear();
    fixture.seen().choose_shift(scene.frame.seen_shift);
    fixture.seen().open_window(fixture.map().window());
    scene.frame.has_seen = 0;
  }
  if (!taken) scene.frame.has_taken = 0;
  fixture.write(fixture.observed, observed);
  fixture.write(fixture.candidates, candidates);
  scene.settle(fixture.candidates);
  scene.list_candidates();
  Creation creation(fixture.commands(), fixture.lists());
  fixture.list_all([&] { creation.filter(scene.frame, scene.list, fixture.candidates, nullptr); }, {&creation.chosen()});
  const std::size_t count = creation.chosen().count();
  creation.create(scene.frame, fixture.camera(), fixture.views(), fixture.seen(), fixture.taken(), scene.settling, scene.list,
                  fixture.visit.removed(), fixture.map());
  const std::vector<std::uint32_t> listed = scene.list.voxels().read(), chosen = creation.chosen().read();
  const std::vector<cl_uint4> surfels = creation.new_surfels().surfels.read(count);
  const std::vector<cl_uint> cells = creation.new_surfels().cells.read(count);
  Created created;
  for (std::size_t n = 0; n < count; ++n)
    created[listed[chosen[n]]] = {surfels[n].s[0], surfels[n].s[1], surfels[n].s[2], surfels[n].s[3], cells[n]};
  if (is_taken == nullptr) return created;
  const int tiles_i = static_cast<int>(tiles(scene.grid.size_i)), words_k = scene.frame.grid.words_k;
  for (const auto& [number, surfel] : created) {
    const int tile = static_cast<int>(number / (64 * VIEW_TILE * VIEW_TILE)),
              column = static_cast<int>(number / 64 % (VIEW_TILE * VIEW_TILE));
    const int i = tile % tiles_i * VIEW_TILE + column % VIEW_TILE, j = tile / tiles_i / words_k * VIEW_TILE + column / VIEW_TILE,
              k = 64 * (tile / tiles_i % words_k) + static_cast<int>(number % 64);
    (*is_taken)[number] = is_among(taken_bits, scene.to_world(scene.grid.center_of(i, j, k)));
  }
  return created;
}

/// At taken points surfels slide as if there were no kept views and no seen points, elsewhere as if nothing were taken. Each of these two
/// is compared with the exact test in test_stage_creation.cpp.
TEST(StageTakenPoints, NewSurfelsAtTakenPointsSlideByThisFrameAlone) {
  std::size_t taken = 0, others = 0, farther = 0;
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    std::map<std::uint32_t, Truth> is_taken;
    const Created mixed = created_with(camera, true, true, &is_taken), by_all = created_with(camera, true, false, nullptr),
                  by_frame = created_with(camera, false, false, nullptr);
    for (const auto& [number, surfel] : mixed) {
      const Truth here = is_taken.at(number);
      const bool in_all = by_all.count(number) != 0;
      ASSERT_TRUE(by_frame.count(number) != 0);
      if (here == Truth::open) continue;
      if (here == Truth::no) {
        ++others;
        EXPECT_TRUE(in_all && by_all.at(number) == surfel) << "candidate " << number;
        continue;
      }
      ++taken;
      EXPECT_TRUE(by_frame.at(number) == surfel) << "candidate " << number;
      farther += in_all && by_all.at(number) != surfel;
    }
  }
  EXPECT_GT(taken, small_tests() ? 0u : 100u) << "nothing was tested";
  EXPECT_GT(others, small_tests() ? 0u : 100u) << "nothing was tested";
  EXPECT_GT(farther, small_tests() ? 0u : 10u) << "kept views hold no surfel back";
}

/// Surfels are removed as ever, and also if the point kFrontProbe radii before them was taken back and this frame does not see it.
void check_visit(CameraSetup camera, Content content, double full_taken, bool remove_buried, std::array<std::size_t, 3>& counts) {
  SCOPED_TRACE(camera.name + ", taken " + std::to_string(full_taken));
  camera.config.remove_buried = remove_buried;
  Scene scene(camera, 5);
  VisitFixture& fixture = scene.fixture;
  Random same_start(5);  // as scene.begin() will draw it
  fixture.map().replace(random_surfels(scene.grid, same_start.pose(2, 3), 600, 2, 2, scene.random), 1);
  scene.random = Random(5);
  scene.begin(0, -1, full_taken, content);
  const Field<char> observed = random_field(fixture.grid(), 0.1, scene.random);
  Field<char> candidates = random_field(fixture.grid(), 0.5, scene.random);
  for_each_voxel(candidates, [&](int i, int j, int k) { candidates(i, j, k) = candidates(i, j, k) && !observed(i, j, k); });
  fixture.write(fixture.observed, observed);
  fixture.write(fixture.candidates, candidates);
  fixture.visit.visit(scene.frame, fixture.camera(), fixture.observed, fixture.space.column_end(), fixture.views(), fixture.taken(),
                      fixture.map(), fixture.candidates);
  const SurfelVisit::Found found = SurfelVisit::read_found(fixture.candidates, fixture.map());
  const std::vector<std::uint32_t> slots = fixture.access().slots(fixture.visit.removed());
  const std::set<std::uint32_t> removed(slots.begin(), slots.end());
  EXPECT_EQ(found.removed, removed.size());

  const SeenBits taken = scene.taken_bits();
  Field<Truth> left = scene.grid.field(Truth::no);
  for_each_voxel(candidates, [&](int i, int j, int k) { left(i, j, k) = truth(candidates(i, j, k)); });
  Comparison comparison("removed");
  for (const Surfel& surfel : fixture.map().download()) {
    const Vector3d p = surfel.position.cast<double>(), n = surfel.normal.cast<double>();
    const Voxel voxel = voxel_of(scene.grid.to_grid(scene.now.T_world_camera.inverse() * p), 1e-4);
    const Vector3i v = voxel.index;
    if (!scene.grid.contains(v)) continue;  // in no voxel, so it stays
    Truth goes = truth(observed(v.x(), v.y(), v.z()));
    if (remove_buried) goes = goes || view_knows(scene.now, p - kBackProbe * surfel.radius * n);
    const Vector3d front = p + kFrontProbe * surfel.radius * n;
    const Truth is_taken = is_among(taken, front), is_seen = view_knows(scene.now, front);
    counts[0] += (!goes && is_taken && !is_seen) == Truth::yes;
    counts[1] += (!goes && is_taken && is_seen) == Truth::yes;
    counts[2] += (!goes && !is_taken && !is_seen) == Truth::yes;
    if (full_taken >= 0) goes = goes || (is_taken && !is_seen);
    if (voxel.open) goes = Truth::open;
    comparison.add(goes, removed.count(surfel.id) != 0, [&] { return "slot " + std::to_string(surfel.id); });
    left(v.x(), v.y(), v.z()) = left(v.x(), v.y(), v.z()) && goes;
  }
  expect_equal("candidates left", left, fixture.read(fixture.candidates));
}

TEST(StageTakenPoints, SurfelsThatFloatInTakenSpaceAreRemoved) {
  std::array<std::size_t, 3> counts = {};  // removed as they float; those that this frame sees before them; those not at taken points
  for (const CameraSetup& camera : cameras())
    for (const Content content : {Content::mixed, Content::all_valid, Content::all_invalid})
      for (const bool remove_buried : {false, true})
        for (const double full_taken : {0.1, 0.5}) check_visit(camera, content, full_taken, remove_buried, counts);
  for (const std::size_t count : counts) EXPECT_GT(count, small_tests() ? 5u : 500u) << "nothing was tested";
}

TEST(StageTakenPoints, NoSurfelFloatsIfNothingIsTaken) {
  std::array<std::size_t, 3> counts = {};
  for (const CameraSetup& camera : cameras()) check_visit(camera, Content::mixed, -1, true, counts);
  EXPECT_EQ(counts[0], 0u);
  EXPECT_GT(counts[2], 0u);
}

}  // namespace
}  // namespace frontier_surfels
