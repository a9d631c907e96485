/// The kernels of removal: which surfels are removed, which candidates remain, and how the map changes.

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "stages/reference_surfels.hpp"
#include "stages/reference_views.hpp"
#include "stages/removal.hpp"
#include "stages/sign_field.hpp"
#include "stages/visit_fixture.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

struct Expected {
  std::vector<Truth> removed;
  Field<Truth> candidates;         ///< candidates left
  std::size_t closed = 0;          ///< surfels removed only because they lie on a thin gap
  std::size_t on_thin_bodies = 0;  ///< surfels that would be removed for this reason if they were not occupied
};

/// A surfel is removed if it lies in an observed voxel. With remove_buried also if this frame sees the point r / 4 behind it. With min_gap
/// also if it is frontier and this frame sees the point min_gap behind it.
Expected expect_removal(const Nuvg& grid, const Config& config, const SeenView& view, const std::vector<Surfel>& map,
                        const std::vector<ViewSurfel>& in_view, const Field<char>& observed, const Field<char>& candidates) {
  Expected expected = {{}, grid.field(Truth::no), 0, 0};
  for_each_voxel(candidates, [&](int i, int j, int k) { expected.candidates(i, j, k) = truth(candidates(i, j, k)); });
  std::map<std::uint32_t, Surfel> by_slot;
  for (const Surfel& surfel : map) by_slot[surfel.id] = surfel;
  for (const ViewSurfel& s : in_view) {
    const Surfel& surfel = by_slot.at(s.slot);
    const Voxel voxel = voxel_of(Vector3d(s.i, s.j, s.k), 2e-5);
    const Vector3i v = voxel.index;
    if (!grid.contains(v)) {
      expected.removed.push_back(voxel.open ? Truth::open : Truth::no);
      continue;
    }
    Truth removed = truth(observed(v.x(), v.y(), v.z()));
    if (config.remove_buried)
      removed = removed || view_knows(view, (surfel.position - 0.25F * surfel.radius * surfel.normal).cast<double>());
    if (config.min_gap > 0) {
      const Vector3d behind = surfel.position.cast<double>() - config.min_gap * surfel.normal.cast<double>();
      const Truth thin = view_knows(view, behind), frontier = truth(surfel.label == Label::kFrontier);
      expected.closed += removed == Truth::no && (thin && frontier) == Truth::yes;
      expected.on_thin_bodies += removed == Truth::no && (thin && !frontier) == Truth::yes;
      removed = removed || (thin && frontier);
    }
    if (voxel.open) removed = Truth::open;
    expected.removed.push_back(removed);
    Truth& candidate = expected.candidates(v.x(), v.y(), v.z());
    candidate = candidate && removed;
  }
  return expected;
}

struct Marked {
  std::size_t removed;
  Expected expected;
};

Marked check_marks(CameraSetup camera, Content content, int count, double density, bool remove_buried, double min_gap) {
  SCOPED_TRACE(camera.name + ", " + std::to_string(count) + " surfels, density " + std::to_string(density) +
               (remove_buried ? ", buried ones too" : "") + ", gaps of " + std::to_string(min_gap) + " m");
  camera.config.remove_buried = remove_buried;
  camera.config.min_gap = min_gap;
  Random random(static_cast<unsigned>(count));
  const Nuvg grid(camera.intrinsics, camera.config);
  VisitFixture fixture(camera.config);
  const SeenView view = {random_image(camera, content, random), random.pose(2, 3), depth_step_for(camera.config.z_max)};
  fixture.map().replace(random_surfels(grid, view.T_world_camera, count, 2, 2, random), 1);
  const std::vector<Surfel> map = fixture.map().download();
  if (count > 10) fixture.access().kill(some_slots(map, count / 3));  // so that numbers of surfels in view differ from slots
  fixture.begin_and_observe(view.image, view.T_world_camera);
  const Field<char> observed = random_field(fixture.grid(), density, random);
  fixture.write(fixture.observed, observed);
  Field<char> candidates = random_field(fixture.grid(), 0.5, random);  // unobserved voxels only, see the next line
  for_each_voxel(candidates, [&](int i, int j, int k) { candidates(i, j, k) = candidates(i, j, k) && !observed(i, j, k); });
  fixture.write(fixture.candidates, candidates);

  EXPECT_EQ(fixture.look(fixture.observed).large, 0u);
  ViewSurfels placed(fixture.commands(), fixture.lists());
  placed.place(fixture.frame(), fixture.visit.in_view(), fixture.map());
  const Expected expected = expect_removal(grid, camera.config, view, map, placed.surfels().read(placed.count()), observed, candidates);
  const std::vector<std::uint64_t> in_view_words = fixture.access().words(fixture.visit.in_view()),
                                   removed_words = fixture.access().words(fixture.visit.removed());
  for (std::size_t n = 0; n < in_view_words.size(); ++n)
    EXPECT_EQ(removed_words[n] & ~in_view_words[n], 0u) << "surfels out of view are removed";
  const std::vector<std::uint32_t> in_view = fixture.in_view_slots(), removed_slots = fixture.access().slots(removed_words);
  const std::set<std::uint32_t> removed(removed_slots.begin(), removed_slots.end());
  {
    Comparison comparison("removed");
    for (std::size_t n = 0; n < in_view.size(); ++n)
      comparison.add(expected.removed[n], removed.count(in_view[n]) != 0, [&] { return "slot " + std::to_string(in_view[n]); });
  }
  expect_equal("candidates left", expected.candidates, fixture.read(fixture.candidates));
  return {removed.size(), expected};
}

TEST(StageRemoval, RandomSurfels) {
  for (const CameraSetup& camera : cameras())
    for (const Content content : {Content::mixed, Content::all_valid, Content::all_invalid})
      for (const double min_gap : {0.0, 0.05})
        for (const bool remove_buried : {false, true}) check_marks(camera, content, 300, 0.3, remove_buried, min_gap);
}

TEST(StageRemoval, NothingAndEverythingObserved) {
  const CameraSetup camera = cameras().front();
  for (const int count : {0, 1, 64, 65, 200}) {
    EXPECT_EQ(check_marks(camera, Content::mixed, count, 0, false, 0).removed, 0u);
    const std::size_t removed = check_marks(camera, Content::mixed, count, 1, false, 0).removed;
    EXPECT_LE(removed, static_cast<std::size_t>(count));
    EXPECT_TRUE(count < 64 || removed > 0);
  }
}

TEST(StageRemoval, BuriedSurfelsAreRemoved) {
  const CameraSetup camera = cameras().front();
  EXPECT_GT(check_marks(camera, Content::all_valid, 300, 0, true, 0).removed, 5u);
}

/// Frontier on gaps down to a tenth of a voxel is removed; the surfaces of equally thin bodies stay.
TEST(StageRemoval, FrontierOnThinGapsIsRemoved) {
  for (const double min_gap : {0.003, 0.03, 0.3}) {
    std::size_t closed = 0, on_thin_bodies = 0;
    for (const CameraSetup& camera : cameras())
      for (const bool remove_buried : {false, true}) {
        const Marked marked = check_marks(camera, Content::all_valid, 600, 0, remove_buried, min_gap);
        closed += marked.expected.closed;
        on_thin_bodies += marked.expected.on_thin_bodies;
      }
    EXPECT_GT(closed, small_tests() ? 5u : 100u) << "nothing was tested";
    EXPECT_GT(on_thin_bodies, small_tests() ? 1u : 50u) << "nothing was tested";
  }
}

TEST(StageRemoval, FreesSlots) {
  for (const int count : {0, 1, 64, 65, 300}) {
    SCOPED_TRACE(std::to_string(count) + " surfels");
    const CameraSetup camera = cameras().front();
    Random random(3);
    const Nuvg grid(camera.intrinsics, camera.config);
    VisitFixture fixture(camera.config);
    fixture.map().replace(random_surfels(grid, Eigen::Isometry3d::Identity(), count, 2, 2, random), 1);
    if (count > 64) fixture.access().kill(some_slots(fixture.map().download(), 20));
    // Nothing is observed: no surfel is at a surface.
    fixture.begin_and_observe(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
    fixture.look();
    fixture.split();
    std::map<std::uint32_t, Surfel> expected;
    for (const Surfel& surfel : fixture.map().download()) expected[surfel.id] = surfel;
    const std::vector<std::uint32_t> slots = fixture.in_view_slots();
    std::vector<std::uint64_t> removed = fixture.access().words(fixture.visit.in_view());
    for (std::uint64_t& word : removed)
      for (int bit = 0; bit < 64; ++bit)
        if (random.chance(0.6)) word &= ~(std::uint64_t{1} << bit);
    BitField removed_bits(fixture.commands());
    removed_bits.resize(removed.size() + 1);
    removed_bits.write(removed);
    std::set<std::uint32_t> removed_slots;
    for (const std::uint32_t slot : fixture.access().slots(removed)) {
      removed_slots.insert(slot);
      expected.erase(slot);
    }
    EXPECT_TRUE(slots.size() < 64 || removed_slots.size() > 10) << "nothing was tested";

    remove_surfels(fixture.commands(), removed_bits, removed_slots.size(), fixture.map());
    for (const std::uint32_t slot : removed_slots) EXPECT_FALSE(fixture.access().is_alive(slot));
    EXPECT_EQ(fixture.map().size(), expected.size());
    const std::vector<Surfel> left = fixture.map().download();
    ASSERT_EQ(left.size(), expected.size());
    for (const Surfel& surfel : left) EXPECT_TRUE(expected.count(surfel.id) && same(surfel, expected[surfel.id])) << surfel.id;
    const Changes changes = fixture.finish(9);
    EXPECT_TRUE(changes.updated.empty());
    EXPECT_TRUE(std::set<std::uint32_t>(changes.removed.begin(), changes.removed.end()) == removed_slots);
  }
}

}  // namespace
}  // namespace frontier_surfels
