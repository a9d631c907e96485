/// kernels/stages/5_visit.cl and 6_split.cl: which surfels reach into the grid, how the grid sees them, and how they are split.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "stages/reference_surfels.hpp"
#include "stages/sign_field.hpp"
#include "stages/visit_fixture.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// Number of times a surfel is split, until r < 2 sqrt(3) delta(z). Open: too close to the limit to decide.
struct Levels {
  int levels;
  bool open;
};

Levels split_levels(const Nuvg& grid, const SeenSurfel& s) {
  const Voxel voxel = voxel_of(s.c, 1e-3);
  Levels result = {0, voxel.open};
  if (!grid.contains(voxel.index)) return result;
  const double limit = 2 * std::sqrt(3.0);
  double r = s.rho / 2;
  for (; r >= limit; r /= 2) {
    ++result.levels;
    result.open = result.open || r < limit + 1e-3;
  }
  result.open = result.open || r > limit - 1e-3;
  return result;
}

/// A map with some free slots, and a view of it. No surfel is so close to the limit that rounding decides whether it is split.
struct Scene {
  CameraSetup camera;
  Nuvg grid;
  Eigen::Isometry3d T_world_camera;
  VisitFixture fixture;

  /// @param anywhere  number of additional surfels around the camera
  Scene(const CameraSetup& with_camera, int count, double around, double largest, unsigned seed, Commands& commands = test_commands(),
        int anywhere = 0)
      : camera(with_camera), grid(camera.intrinsics, camera.config), fixture(camera.config, commands) {
    Random random(seed);
    T_world_camera = random.pose(2, 3);
    std::vector<Surfel> surfels;
    while (static_cast<int>(surfels.size()) < count)
      for (const Surfel& surfel : random_surfels(grid, T_world_camera, 1, around, largest, random))
        if (!split_levels(grid, seen(quantised(surfel, camera.config))).open) surfels.push_back(surfel);
    for (int n = 0; n < anywhere; ++n) {
      surfels.push_back(random_surfels(grid, T_world_camera, 1, 0, 1, random).front());
      surfels.back().position = (T_world_camera * (random.direction() * random.uniform(0, 2 * camera.config.z_max))).cast<float>();
    }
    std::vector<std::uint32_t> dead;
    for (const std::uint32_t slot : fixture.map().replace(surfels, 1))
      if (slot / PAGE_SLOTS % 4 != 3 && random.chance(0.1)) dead.push_back(slot);  // full pages stay
    fixture.access().kill(dead);
    fixture.begin_and_observe(random_image(camera, Content::all_invalid, random), T_world_camera);  // no surfaces to label surfels at
  }
  SeenSurfel seen(const Surfel& surfel) const { return see(grid, T_world_camera.inverse(), surfel); }
};

/// Does the surfel's ellipsoid contain the centre of a voxel of the grid, or of a voxel beside the grid?
bool touches_grid(const Scene& scene, const SeenSurfel& s) {
  for (int i = -1; i <= scene.grid.size_i; ++i)
    for (int j = -1; j <= scene.grid.size_j; ++j)
      for (int k = -1; k <= scene.grid.size_k; ++k) {
        const Vector3d d = Vector3d(i, j, k) - s.c;
        if (std::abs(d.z()) > std::max(s.rho, scene.camera.config.thickness)) continue;
        const Vector3d u(d.x() + s.ray.x() * d.z(), d.y() + s.ray.y() * d.z(), d.z());
        const double along = u.dot(s.normal), in_plane = (u - along * s.normal).norm();
        if (std::hypot(along / scene.camera.config.thickness, in_plane / s.rho) < 0.999) return true;
      }
  return false;
}

/// Is the surfel so far from the grid that it must not be selected? The kernel may select some surfels nearby that do not touch the grid.
bool far_from_grid(const Scene& scene, const SeenSurfel& s) {
  const double reach = 3 * (std::max(s.rho, scene.camera.config.thickness) + 2);  // [voxel]
  for (int axis = 0; axis < 2; ++axis) {
    const double slope = std::abs(s.p_camera[axis]) / std::max(s.p_camera.z(), scene.grid.z_min);  // holds in the cuboid, too
    const double along = reach * (1 + slope), size = axis == 0 ? scene.grid.size_i : scene.grid.size_j;
    if (s.c[axis] < -along || s.c[axis] > size + along) return true;
  }
  return s.c.z() < -reach || s.p_camera.z() > scene.camera.config.z_max + reach * scene.grid.voxel_size(s.p_camera.z());
}

struct Selected {
  std::size_t must = 0, must_not = 0;  ///< numbers of surfels that must be in view, and that must not
};

/// Expects that all surfels that touch the grid are in view, and none that is far from it.
Selected check_selection(const Scene& scene) {
  Selected selected;
  std::vector<std::uint32_t> slots = scene.fixture.in_view_slots();
  std::sort(slots.begin(), slots.end());
  EXPECT_TRUE(std::adjacent_find(slots.begin(), slots.end()) == slots.end());
  std::size_t alive = 0;
  for (const Surfel& surfel : scene.fixture.map().download()) {
    const bool in_view = std::binary_search(slots.begin(), slots.end(), surfel.id);
    const SeenSurfel s = scene.seen(surfel);
    alive += in_view;
    if (touches_grid(scene, s)) {
      ++selected.must;
      EXPECT_TRUE(in_view) << "surfel " << surfel.id << " at " << s.c.transpose();
    } else if (far_from_grid(scene, s)) {
      ++selected.must_not;
      EXPECT_FALSE(in_view) << "surfel " << surfel.id << " at " << s.c.transpose();
    }
  }
  EXPECT_EQ(alive, slots.size()) << "surfels are in view that are not in the map";
  return selected;
}

TEST(StageSurfelsInView, Selection) {
  Selected all;
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 130, 24, 2, 1);
    const std::size_t count = scene.fixture.look().in_view;
    EXPECT_EQ(count, scene.fixture.in_view_slots().size());
    const Selected selected = check_selection(scene);
    all.must += selected.must;
    all.must_not += selected.must_not;
  }
  EXPECT_GT(all.must, small_tests() ? 3u : 50u) << "nothing was tested";
  EXPECT_GT(all.must_not, small_tests() ? 3u : 50u) << "nothing was tested";
}

/// Full, partly full and empty pages, with all, some and none of their surfels in view.
TEST(StageSurfelsInView, Pages) {
  std::size_t full = 0, partly = 0, empty = 0, all = 0, some = 0, none = 0;
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 400, 3, 2, 6, test_commands(), 1000);
    VisitFixture& fixture = scene.fixture;
    const std::vector<std::uint32_t> pages = fixture.access().window_pages();
    ASSERT_FALSE(pages.empty());
    std::vector<std::uint32_t> dead;
    for (const std::size_t n : {pages.size() / 4, pages.size() / 2})
      for (std::uint32_t bit = 0; bit < PAGE_SLOTS; ++bit)
        if (fixture.access().is_alive(PAGE_SLOTS * pages[n] + bit)) dead.push_back(PAGE_SLOTS * pages[n] + bit);
    std::sort(dead.begin(), dead.end());
    dead.erase(std::unique(dead.begin(), dead.end()), dead.end());
    fixture.access().kill(dead);
    const std::size_t count = fixture.look().in_view;
    EXPECT_EQ(count, fixture.in_view_slots().size());
    check_selection(scene);
    const std::vector<std::uint64_t> in_view = fixture.access().words(fixture.visit.in_view()),
                                     large = fixture.access().words(fixture.visit.large());
    for (std::size_t n = 0; n < pages.size(); ++n) {
      const std::uint64_t alive = fixture.access().alive_word(pages[n]);
      EXPECT_EQ(in_view[n] & ~alive, 0u) << "free slots are in view";
      EXPECT_EQ(large[n] & ~in_view[n], 0u) << "large, but not in view";
      full += ~alive == 0;
      empty += alive == 0;
      partly += alive != 0 && ~alive != 0;
      if (alive == 0) continue;
      all += in_view[n] == alive;
      none += in_view[n] == 0;
      some += in_view[n] != alive && in_view[n] != 0;
    }
  }
  for (const std::size_t pages : {partly, empty, all, some, none}) EXPECT_GT(pages, 2u) << "nothing was tested";
  EXPECT_TRUE(full > 0 || small_tests());
}

/// Expects that the large surfels are the ones in the grid that are to be split. @return their number
std::size_t check_large(const Scene& scene) {
  const std::vector<std::uint32_t> slots = scene.fixture.access().slots(scene.fixture.visit.large());
  const std::set<std::uint32_t> large(slots.begin(), slots.end());
  std::size_t of_map = 0;
  for (const Surfel& surfel : scene.fixture.map().download()) {
    const Levels expected = split_levels(scene.grid, scene.seen(surfel));
    of_map += large.count(surfel.id);
    if (expected.open) continue;
    EXPECT_EQ(large.count(surfel.id) != 0, expected.levels > 0) << "slot " << surfel.id;
  }
  EXPECT_EQ(of_map, slots.size());
  return of_map;
}

TEST(StageSurfelsInView, Large) {
  std::size_t large = 0;
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 200, 6, 10, 7);
    scene.fixture.look();
    large += check_large(scene);
  }
  EXPECT_GT(large, 20u) << "nothing was tested";
}

TEST(StageSurfelsInView, SizesOfTheMap) {
  const CameraSetup camera = cameras().front();
  for (const int count : {0, 1, 63, 64, 65, 129}) {
    SCOPED_TRACE(std::to_string(count) + " surfels");
    Scene scene(camera, count, -1, 2, 2);  // all well in the grid
    const SurfelVisit::Found found = scene.fixture.look();
    EXPECT_EQ(found.in_view, scene.fixture.map().size());
    EXPECT_EQ(found.large, 0u);
    EXPECT_EQ(scene.fixture.split(), 0u);
  }
}

TEST(StageSurfelsInView, HowTheGridSeesThem) {
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 200, 5, 3, 3);
    const std::vector<Surfel> surfels = scene.fixture.map().download();
    scene.fixture.access().make_ragged({surfels[3].id, surfels[50].id, surfels[90].id});
    EXPECT_EQ(scene.fixture.look().large, 0u);
    const std::vector<std::uint32_t> slots = scene.fixture.in_view_slots();
    ViewSurfels view_surfels(scene.fixture.commands(), scene.fixture.lists());
    view_surfels.place(scene.fixture.frame(), scene.fixture.visit.in_view(), scene.fixture.map());
    const std::vector<ViewSurfel> placed = view_surfels.surfels().read(view_surfels.count());
    ASSERT_EQ(placed.size(), slots.size());
    std::map<std::uint32_t, Surfel> map;
    for (const Surfel& surfel : surfels) map[surfel.id] = surfel;
    for (std::size_t n = 0; n < placed.size(); ++n) {
      const ViewSurfel& actual = placed[n];
      ASSERT_EQ(actual.slot, slots[n]);
      EXPECT_EQ(actual.ragged, actual.slot == surfels[3].id || actual.slot == surfels[50].id || actual.slot == surfels[90].id ? 1u : 0u);
      const SeenSurfel s = scene.seen(map.at(actual.slot));
      if (std::abs(s.p_camera.z() - scene.grid.z_min) < 1e-5) continue;  // may be in the cuboid or in the pyramid
      SCOPED_TRACE("slot " + std::to_string(actual.slot));
      EXPECT_NEAR(actual.i, s.c.x(), 1e-3);
      EXPECT_NEAR(actual.j, s.c.y(), 1e-3);
      EXPECT_NEAR(actual.k, s.c.z(), 1e-3);
      EXPECT_NEAR(actual.reach, s.rho, 1e-4);
      EXPECT_NEAR(actual.n_x, s.normal.x(), 1e-5);
      EXPECT_NEAR(actual.n_y, s.normal.y(), 1e-5);
      EXPECT_NEAR(actual.n_z, s.normal.z(), 1e-5);
      EXPECT_NEAR(actual.n_k, s.n_k, 1e-5);
      EXPECT_NEAR(actual.ray_x, s.ray.x(), 1e-5);
      EXPECT_NEAR(actual.ray_y, s.ray.y(), 1e-5);
    }
  }
}

/// Splits literally, `levels` times: four surfels of radius r / 2 at p +- r / (2 sqrt 2) x_psi +- r / (2 sqrt 2) y_psi.
void split_literally(const Vector3d& p, double r, int levels, const Vector3d& x_psi, const Vector3d& y_psi,
                     std::vector<Vector3d>& centers) {
  if (levels == 0) {
    centers.push_back(p);
    return;
  }
  const double step = r / (2 * std::sqrt(2.0));
  for (const int a : {-1, 1})
    for (const int b : {-1, 1}) split_literally(p + step * (a * x_psi + b * y_psi), r / 2, levels - 1, x_psi, y_psi, centers);
}

/// @param step  step of the map's positions [m]
void check_children(const Surfel& parent, int levels, const std::vector<Surfel>& children, double step) {
  const Vector3d p = parent.position.cast<double>(), n = parent.normal.cast<double>();
  Vector3d corner = Vector3d::Zero();
  double area = 0;
  for (const Surfel& child : children) {
    const Vector3d offset = child.position.cast<double>() - p;
    if (offset.norm() > corner.norm()) corner = offset;
    EXPECT_NEAR(offset.dot(n), 0, 1e-4 * parent.radius + step);
    EXPECT_EQ(child.radius, parent.radius / static_cast<float>(1 << levels)) << "16 bits must hold it exactly";
    EXPECT_TRUE(child.normal == parent.normal && child.label == parent.label && child.rgb == parent.rgb);
    area += static_cast<double>(child.radius) * child.radius;
  }
  EXPECT_NEAR(area, static_cast<double>(parent.radius) * parent.radius, 1e-5 * area);
  // Any two axes may span the disc. They are taken from the result: a corner lies between x_psi and y_psi.
  const Vector3d x_psi = Eigen::AngleAxisd(-M_PI / 4, n) * corner.normalized();
  std::vector<Vector3d> expected;
  split_literally(p, parent.radius, levels, x_psi, n.cross(x_psi), expected);
  ASSERT_EQ(expected.size(), children.size());
  for (const Vector3d& center : expected) {
    double nearest = 1e9;
    for (const Surfel& child : children) nearest = std::min(nearest, (child.position.cast<double>() - center).norm());
    EXPECT_LT(nearest, 1e-3 * parent.radius + 3 * step) << "no surfel at an expected place";
  }
}

using BySlot = std::map<std::uint32_t, Surfel>;

BySlot by_slot(const std::vector<Surfel>& surfels) {
  BySlot sorted;
  for (const Surfel& surfel : surfels) sorted[surfel.id] = surfel;
  return sorted;
}

/// Result of splitting, and the changes that should be reported.
struct Split {
  std::size_t parents = 0, children = 0;
  int most_levels = 0;
  std::set<std::uint32_t> updated, removed;
};

/// @param in_view  slots of the surfels in view, page after page; parents are split in this order
Split check_split(const Scene& scene, const BySlot& before, const std::vector<std::uint32_t>& in_view) {
  const BySlot after = by_slot(scene.fixture.map().download());
  Split split;
  std::vector<std::pair<std::uint32_t, int>> parents;  // slots and levels
  std::set<std::uint32_t> stay;
  for (const auto& [slot, surfel] : before) stay.insert(slot);
  for (const std::uint32_t slot : in_view) {
    const int levels = split_levels(scene.grid, scene.seen(before.at(slot))).levels;
    if (levels == 0) continue;
    parents.emplace_back(slot, levels);
    stay.erase(slot);
    split.removed.insert(slot);
    split.children += std::size_t{1} << (2 * levels);
    split.most_levels = std::max(split.most_levels, levels);
  }
  split.parents = parents.size();
  for (const std::uint32_t slot : stay) EXPECT_TRUE(after.count(slot) != 0 && same(after.at(slot), before.at(slot))) << "slot " << slot;
  EXPECT_EQ(after.size(), before.size() + split.children - split.parents);
  const NewSurfels& children = scene.fixture.splitting.children();
  const std::vector<std::uint32_t> slots =
      scene.fixture.access().find_slots(children.surfels.read(split.children), children.cells.read(split.children), stay);
  auto next = slots.begin();
  for (const auto& [slot, levels] : parents) {
    SCOPED_TRACE("slot " + std::to_string(slot) + ", levels " + std::to_string(levels));
    std::vector<Surfel> of_parent;
    for (int child = 0; child < 1 << (2 * levels); ++child, ++next) {
      EXPECT_TRUE(split.updated.insert(*next).second) << "two surfels in one slot";
      of_parent.push_back(after.at(*next));
    }
    check_children(before.at(slot), levels, of_parent, position_step(scene.camera.config));
  }
  for (const std::uint32_t slot : split.updated) split.removed.erase(slot);  // a child took the parent's slot
  return split;
}

TEST(StageSurfelsInView, Split) {
  int most_levels = 0;
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 150, 3, 20, 4);
    const BySlot before = by_slot(scene.fixture.map().download());
    scene.fixture.look();
    const std::vector<std::uint32_t> in_view = scene.fixture.in_view_slots();
    const std::size_t added = scene.fixture.split();
    const Split split = check_split(scene, before, in_view);
    check_selection(scene);  // children are treated like other surfels; parents are gone
    check_large(scene);      // children at another depth may be large again
    EXPECT_EQ(added, split.children - split.parents);
    EXPECT_EQ(scene.fixture.map().size(), before.size() + added);
    most_levels = std::max(most_levels, split.most_levels);
    const Changes told = scene.fixture.finish(7);
    std::set<std::uint32_t> updated;
    for (const Surfel& surfel : told.updated) updated.insert(surfel.id);
    EXPECT_TRUE(updated == split.updated);
    EXPECT_TRUE(std::set<std::uint32_t>(told.removed.begin(), told.removed.end()) == split.removed);
  }
  EXPECT_GE(most_levels, 3) << "nothing was tested";
}

/// After a split the results are the same as if the surfels had been small before.
TEST(StageSurfelsInView, NothingIsLeftOfParents) {
  std::size_t added = 0, removed = 0;
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 300, 1, 20, 8);
    VisitFixture& fixture = scene.fixture;
    Random random(9);
    fixture.begin_and_observe(random_image(camera, Content::mixed, random), scene.T_world_camera);
    fixture.look();
    added += fixture.split();
    const auto candidates = fixture.read(fixture.candidates);
    const auto in_view = fixture.access().words(fixture.visit.in_view()), removed_words = fixture.access().words(fixture.visit.removed());
    fixture.find_candidates(fixture.space.bits());
    const std::size_t count = fixture.look().in_view;
    EXPECT_EQ(count, fixture.in_view_slots().size());
    EXPECT_TRUE(in_view == fixture.access().words(fixture.visit.in_view()));
    EXPECT_TRUE(removed_words == fixture.access().words(fixture.visit.removed()));
    EXPECT_TRUE(candidates.values == fixture.read(fixture.candidates).values);
    removed += fixture.access().slots(removed_words).size();
  }
  EXPECT_GT(added, small_tests() ? 10u : 100u) << "nothing was tested";
  EXPECT_GT(removed, small_tests() ? 0u : 10u) << "nothing was tested";
}

TEST(StageSurfelsInView, SplitDoesNotDependOnThreads) {
  const auto one_thread = one_thread_commands();
  if (one_thread == nullptr) GTEST_SKIP() << "The device " << test_commands().device().description << " cannot be limited to one thread.";
  const CameraSetup camera = cameras().back();
  std::vector<std::vector<Surfel>> maps;
  for (Commands* with : {&test_commands(), one_thread.get()}) {
    Scene scene(camera, 500, 3, 20, 5, *with);
    scene.fixture.look();
    EXPECT_GT(scene.fixture.split(), 0u);
    maps.push_back(scene.fixture.map().download());
  }
  EXPECT_TRUE(std::equal(maps[0].begin(), maps[0].end(), maps[1].begin(), maps[1].end(), same));
}

}  // namespace
}  // namespace frontier_surfels
