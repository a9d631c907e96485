/// kernels/3_surfels_in_view.cl: which surfels reach into the grid, how it sees them, and their split.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "stages/reference_surfels.hpp"
#include "stages/stages_probe.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// How often a surfel is split: until r < 2 sqrt(3) delta(z). Open: too close to call.
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

/// A map with some free slots, and a view of it. No surfel is so large that its split is a matter of rounding.
struct Scene {
  Camera camera;
  Nuvg grid;
  Eigen::Isometry3d T_world_camera;
  StagesProbe probe;

  Scene(const Camera& with_camera, int count, double around, double largest, unsigned seed, Commands& commands = test_commands())
      : camera(with_camera), grid(camera.intrinsics, camera.config), probe(camera.config, commands) {
    Random random(seed);
    T_world_camera = random.pose(2, 3);
    std::vector<Surfel> surfels;
    while (static_cast<int>(surfels.size()) < count)
      for (const Surfel& surfel : random_surfels(grid, T_world_camera, 1, around, largest, random))
        if (!split_levels(grid, seen(quantised(surfel, camera.config))).open) surfels.push_back(surfel);
    std::vector<std::uint32_t> dead;
    for (const std::uint32_t slot : probe.map().replace(surfels, 1))
      if (random.chance(0.1)) dead.push_back(slot);
    probe.kill(dead);
    probe.stages().begin_frame(random_image(camera, Content::all_invalid, random), T_world_camera, 7);
  }
  SeenSurfel seen(const Surfel& surfel) const { return see(grid, T_world_camera.inverse(), surfel); }
};

/// Does a voxel of the grid, or one beside it, lie in the surfel's ellipsoid?
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

/// Is the surfel so far beyond the grid that even a generous selection leaves it out?
bool far_from_grid(const Scene& scene, const SeenSurfel& s) {
  const double reach = 3 * (std::max(s.rho, scene.camera.config.thickness) + 2);  // [voxel]
  for (int axis = 0; axis < 2; ++axis) {
    const double along = reach * (1 + std::abs(s.ray[axis])), size = axis == 0 ? scene.grid.size_i : scene.grid.size_j;
    if (s.c[axis] < -along || s.c[axis] > size + along) return true;
  }
  return s.c.z() < -reach || s.p_camera.z() > scene.camera.config.z_max + reach * scene.grid.voxel_size(s.p_camera.z());
}

TEST(StageSurfelsInView, Selection) {
  std::size_t must = 0, must_not = 0;
  for (const Camera& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 130, 24, 2, 1);
    const std::vector<Surfel> surfels = scene.probe.map().download();
    const std::size_t count = scene.probe.stages().select_in_view();
    std::vector<std::uint32_t> slots = scene.probe.in_view_slots();
    ASSERT_EQ(slots.size(), count);
    std::sort(slots.begin(), slots.end());
    EXPECT_TRUE(std::adjacent_find(slots.begin(), slots.end()) == slots.end());
    std::size_t alive = 0;
    for (const Surfel& surfel : surfels) {
      const bool selected = std::binary_search(slots.begin(), slots.end(), surfel.id);
      const SeenSurfel s = scene.seen(surfel);
      alive += selected;
      if (touches_grid(scene, s)) {
        ++must;
        EXPECT_TRUE(selected) << "surfel " << surfel.id << " at " << s.c.transpose();
      } else if (far_from_grid(scene, s)) {
        ++must_not;
        EXPECT_FALSE(selected) << "surfel " << surfel.id << " at " << s.c.transpose();
      }
    }
    EXPECT_EQ(alive, count) << "surfels are in view that are not in the map";
  }
  EXPECT_GT(must, small_tests() ? 3u : 50u) << "nothing was tested";
  EXPECT_GT(must_not, small_tests() ? 3u : 50u) << "nothing was tested";
}

TEST(StageSurfelsInView, SizesOfTheMap) {
  const Camera camera = cameras().front();
  for (const int count : {0, 1, 63, 64, 65, 129}) {
    SCOPED_TRACE(std::to_string(count) + " surfels");
    Scene scene(camera, count, -1, 2, 2);  // all well in the grid
    EXPECT_EQ(scene.probe.stages().select_in_view(), scene.probe.map().size());
    EXPECT_EQ(scene.probe.stages().split_surfels(), 0u);
  }
}

TEST(StageSurfelsInView, HowTheGridSeesThem) {
  for (const Camera& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 200, 5, 3, 3);
    const std::vector<Surfel> surfels = scene.probe.map().download();
    scene.probe.make_ragged({surfels[3].id, surfels[50].id, surfels[90].id});
    scene.probe.stages().select_in_view();
    EXPECT_EQ(scene.probe.stages().split_surfels(), 0u);
    const std::vector<std::uint32_t> slots = scene.probe.in_view_slots();
    const std::vector<ViewSurfel> placed = scene.probe.view_surfels();
    std::map<std::uint32_t, Surfel> map;
    for (const Surfel& surfel : surfels) map[surfel.id] = surfel;
    for (std::size_t n = 0; n < placed.size(); ++n) {
      const ViewSurfel& actual = placed[n];
      ASSERT_EQ(actual.slot, slots[n]);
      EXPECT_EQ(actual.ragged, actual.slot == surfels[3].id || actual.slot == surfels[50].id || actual.slot == surfels[90].id ? 1u : 0u);
      const SeenSurfel s = scene.seen(map.at(actual.slot));
      if (std::abs(s.p_camera.z() - scene.grid.z_min) < 1e-5) continue;  // either part of the grid
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

/// Four of r / 2 at p +- r / (2 sqrt 2) x_psi +- r / (2 sqrt 2) y_psi, literally, again and again.
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

/// @param step  of the map's positions [m]
void check_children(const Surfel& parent, int levels, const std::vector<Surfel>& children, double step) {
  const Vector3d p = parent.position.cast<double>(), n = parent.normal.cast<double>();
  Vector3d corner = Vector3d::Zero();
  double area = 0;
  for (const Surfel& child : children) {
    const Vector3d offset = child.position.cast<double>() - p;
    if (offset.norm() > corner.norm()) corner = offset;
    EXPECT_NEAR(offset.dot(n), 0, 1e-4 * parent.radius + step);
    EXPECT_EQ(child.radius, parent.radius / static_cast<float>(1 << levels)) << "16 bits hold it exactly";
    EXPECT_TRUE(child.normal == parent.normal && child.label == parent.label && child.rgb == parent.rgb);
    area += static_cast<double>(child.radius) * child.radius;
  }
  EXPECT_NEAR(area, static_cast<double>(parent.radius) * parent.radius, 1e-5 * area);
  // Which axes span the disc is free, so they are taken from the result: a corner lies between x_psi and y_psi.
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

/// What splitting has made of the surfels in view, and what is told of it.
struct Split {
  std::size_t parents = 0, children = 0;
  int most_levels = 0;
  std::set<std::uint32_t> updated, removed;
};

Split check_split(Scene& scene, const BySlot& before, const std::vector<std::uint32_t>& in_view) {
  const BySlot after = by_slot(scene.probe.map().download());
  const std::vector<std::uint32_t> slots = scene.probe.in_view_slots();
  const std::vector<ViewSurfel> placed = scene.probe.view_surfels();
  Split split;
  for (std::size_t n = 0; n < in_view.size(); ++n) {
    const Levels expected = split_levels(scene.grid, scene.seen(before.at(in_view[n])));
    SCOPED_TRACE("slot " + std::to_string(in_view[n]) + ", levels " + std::to_string(expected.levels));
    split.most_levels = std::max(split.most_levels, expected.levels);
    if (expected.levels == 0) {
      EXPECT_TRUE(same(after.at(in_view[n]), before.at(in_view[n])));
      continue;
    }
    ++split.parents;
    split.removed.insert(in_view[n]);
    EXPECT_LT(placed[n].i, -1e5F) << "the parent is still in view";
    std::vector<Surfel> children;
    for (int child = 0; child < 1 << (2 * expected.levels); ++child) {
      const std::size_t number = in_view.size() + split.children++;
      EXPECT_EQ(placed.at(number).slot, slots.at(number));
      EXPECT_TRUE(split.updated.insert(slots.at(number)).second) << "two surfels in one slot";
      children.push_back(after.at(slots.at(number)));
    }
    check_children(before.at(in_view[n]), expected.levels, children, position_step(scene.camera.config));
  }
  EXPECT_EQ(slots.size(), in_view.size() + split.children);
  EXPECT_EQ(after.size(), before.size() + split.children - split.parents);
  for (const std::uint32_t slot : split.updated) split.removed.erase(slot);  // taken again
  return split;
}

TEST(StageSurfelsInView, Split) {
  int most_levels = 0;
  for (const Camera& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Scene scene(camera, 150, 3, 20, 4);
    const BySlot before = by_slot(scene.probe.map().download());
    scene.probe.stages().select_in_view();
    const std::vector<std::uint32_t> in_view = scene.probe.in_view_slots();
    const std::size_t added = scene.probe.stages().split_surfels();
    const Split split = check_split(scene, before, in_view);
    EXPECT_EQ(added, split.children - split.parents);
    EXPECT_EQ(scene.probe.map().size(), before.size() + added);
    most_levels = std::max(most_levels, split.most_levels);
    scene.probe.stages().finish_frame();
    const Changes told = scene.probe.map().last_changes();
    std::set<std::uint32_t> updated;
    for (const Surfel& surfel : told.updated) updated.insert(surfel.id);
    EXPECT_TRUE(updated == split.updated);
    EXPECT_TRUE(std::set<std::uint32_t>(told.removed.begin(), told.removed.end()) == split.removed);
  }
  EXPECT_GE(most_levels, 3) << "nothing was tested";
}

TEST(StageSurfelsInView, SplitDoesNotDependOnThreads) {
  const auto parts = test_commands().device().device.getInfo<CL_DEVICE_PARTITION_PROPERTIES>();
  if (std::find(parts.begin(), parts.end(), CL_DEVICE_PARTITION_BY_COUNTS) == parts.end())
    GTEST_SKIP() << "The device " << test_commands().device().description << " cannot be limited to one thread.";
  Config one;
  one.platform = test_platform();
  one.threads = 1;
  Commands one_thread(choose_device(one));
  const Camera camera = cameras().back();
  std::vector<std::vector<Surfel>> maps;
  for (Commands* with : {&test_commands(), &one_thread}) {
    Scene scene(camera, 500, 3, 20, 5, *with);
    scene.probe.stages().select_in_view();
    EXPECT_GT(scene.probe.stages().split_surfels(), 0u);
    maps.push_back(scene.probe.map().download());
  }
  EXPECT_TRUE(std::equal(maps[0].begin(), maps[0].end(), maps[1].begin(), maps[1].end(), same));
}

}  // namespace
}  // namespace frontier_surfels
