/// kernels/stages/11_sign_field.cl compared with the dense sign field and the definition of its events, with 1 and with 64 work items per
/// tile.

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <optional>

#include "frame/view_grid.hpp"
#include "stages/path_fields.hpp"
#include "stages/reference_paths.hpp"
#include "stages/reference_sign_field.hpp"
#include "stages/reference_surfels.hpp"
#include "stages/sign_field.hpp"
#include "stages/surfel_visit.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// Builds the variant of the kernel that is not used on this type of device.
Commands& other_commands() {
  static auto* const commands = [] {
    Device device = test_device();
    device.is_pocl_cpu = !device.is_pocl_cpu;
    return new Commands(device);
  }();
  return *commands;
}

/// A surfel given in grid coordinates, as the view sees it. Expects that no cosine equals the threshold.
ViewSurfel make_view_surfel(const Grid& g, const Limits& limits, const Eigen::Vector3d& c, const Eigen::Vector3d& n, double reach) {
  const bool pyramid = c.z() >= g.k_min;
  ViewSurfel s = {};
  s.i = static_cast<float>(c.x());
  s.j = static_cast<float>(c.y());
  s.k = static_cast<float>(c.z());
  s.reach = static_cast<float>(reach);
  s.n_x = static_cast<float>(n.x());
  s.n_y = static_cast<float>(n.y());
  s.n_z = static_cast<float>(n.z());
  s.ray_x = pyramid ? (s.i - g.center_i) / g.fx : 0;
  s.ray_y = pyramid ? (s.j - g.center_j) / g.fy : 0;
  s.n_k = static_cast<float>(n.dot(Eigen::Vector3d(s.ray_x, s.ray_y, 1).normalized()));
  for (const float cosine : {s.n_x, s.n_y, s.n_k}) EXPECT_NE(std::abs(cosine), limits.th_d);
  return s;
}

/// Surfels in the grid and around it. Some are large, because surfels beyond the grid are not split.
std::vector<ViewSurfel> random_view_surfels(const Grid& g, const Limits& limits, int count, Random& random) {
  std::vector<ViewSurfel> surfels;
  for (int n = 0; n < count; ++n) {
    constexpr double kAround = 5;
    const Eigen::Vector3d c(random.uniform(-kAround, g.size_i + kAround), random.uniform(-kAround, g.size_j + kAround),
                            random.uniform(-kAround, g.size_k + kAround));
    surfels.push_back(
        make_view_surfel(g, limits, c, random.direction(), random.chance(0.1) ? random.uniform(6, 13) : random.uniform(0.6, 5)));
    surfels.back().ragged = random.chance(0.1);
  }
  return surfels;
}

/// Compares the events on the paths through `voxels`; other paths are not computed.
void compare(const FrameFixture& fixture, const BitField& events, const reference::SignField& expected, const Field<char>& voxels) {
  const char* names[] = {"enter forward", "exit forward", "enter backward", "exit backward", "invalid"};
  const std::vector<Field<char>> paths = paths_through(voxels);
  for (int family = 0; family < 3; ++family) {
    for (int event = EVENT_ENTER_FORWARD; event < EVENT_PLANES; ++event) {
      Comparison comparison(std::string(names[event]) + ", family " + std::to_string(family));
      const Field<char> actual = fixture.read(events, event_offset(fixture.grid(), family, event));
      for_each_voxel(actual, [&](int i, int j, int k) {
        if (!on_path(paths, family, i, j, k)) return;
        const Truth wanted = event == EVENT_INVALID ? expected.invalid(family)(i, j, k) : expected.event(family, event, i, j, k);
        comparison.add(wanted, actual(i, j, k), [=] { return voxel_text(i, j, k); });
      });
    }
  }
}

using MakeSurfels = std::function<std::vector<ViewSurfel>(const Grid&, const Limits&)>;

/// The surfel in the world frame, for a camera at the origin.
Surfel to_map(const Nuvg& grid, const ViewSurfel& s) {
  const Eigen::Vector3d p = grid.from_grid(Eigen::Vector3d(s.i, s.j, s.k));
  Surfel surfel;
  surfel.position = p.cast<float>();
  surfel.normal = Eigen::Vector3f(s.n_x, s.n_y, s.n_z);
  surfel.radius = static_cast<float>(s.reach / 2 * grid.voxel_size(p.z()));
  return surfel;
}

/// Puts surfels into the map and places the ones in view. @return all surfels; the ones in view as placed, because the map rounds them. The
/// others must make no difference.
std::vector<ViewSurfel> put_into_map(const CameraSetup& camera, FrameFixture& fixture, ViewSurfels& view_surfels,
                                     std::vector<ViewSurfel> surfels) {
  const Nuvg grid(camera.intrinsics, camera.config);
  Random random(1);
  std::vector<Surfel> map;
  for (const ViewSurfel& surfel : surfels) map.push_back(to_map(grid, surfel));
  const std::vector<std::uint32_t> slots = fixture.map().replace(map, 1);
  std::map<std::uint32_t, ViewSurfel*> by_slot;
  for (std::size_t n = 0; n < surfels.size(); ++n) {
    by_slot[slots[n]] = &surfels[n];
    if (surfels[n].ragged != 0) fixture.access().make_ragged({slots[n]});
  }
  fixture.begin(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
  Commands& commands = fixture.commands();
  BitField observed(commands);
  fixture.write(observed, Field<char>(fixture.grid(), 0));
  DeviceArray<cl_int> column_end(commands);
  column_end.write(std::vector<cl_int>(camera.intrinsics.width * camera.intrinsics.height, 0));
  Candidates candidates(commands);
  SurfelVisit visit(commands);
  candidates.find(fixture.camera().grid(), observed);
  visit.visit(fixture.frame(), fixture.camera(), observed, column_end, fixture.views(), fixture.taken(), fixture.map(), candidates);
  view_surfels.place(fixture.frame(), visit.in_view(), fixture.map());
  for (const ViewSurfel& placed : view_surfels.surfels().read(view_surfels.count())) {
    ViewSurfel& meant = *by_slot.at(placed.slot);
    EXPECT_LT((Eigen::Vector3d(placed.i, placed.j, placed.k) - Eigen::Vector3d(meant.i, meant.j, meant.k)).norm(), 0.01);
    EXPECT_EQ(placed.ragged, meant.ragged);
    meant = placed;
  }
  return surfels;
}

/// @param candidate_density  share of candidate voxels; only the paths around these are needed
void check(const CameraSetup& camera, const MakeSurfels& make_surfels, double candidate_density = 1) {
  SCOPED_TRACE(camera.name);
  std::optional<reference::SignField> expected;
  for (Commands* commands : {&test_commands(), &other_commands()}) {
    SCOPED_TRACE(commands->shape().heavy_group == 1 ? "one work item per tile" : "64 work items per tile");
    Random random(1);
    FrameFixture fixture(camera.config, *commands);
    ViewSurfels view_surfels(*commands, fixture.lists());
    const Grid grid = make_view_grid(camera.intrinsics, camera.config).grid;
    const std::vector<ViewSurfel> surfels = put_into_map(camera, fixture, view_surfels, make_surfels(grid, fixture.limits()));
    if (!expected) expected.emplace(grid, fixture.limits(), surfels);
    const Field<char> candidates = random_field(grid, candidate_density, random);
    Candidates candidate_bits(*commands);
    NeededPaths needed(*commands);
    frontier_surfels::SignField field(*commands, fixture.lists());
    need_paths_around(fixture, random_field(grid, 0.5, random), candidate_bits, needed);
    field.compute(fixture.frame(), needed, view_surfels);  // its results must not affect the next ones
    need_paths_around(fixture, candidates, candidate_bits, needed);
    field.compute(fixture.frame(), needed, view_surfels);
    compare(fixture, field.events(), *expected, around(candidates, 1));
  }
}

TEST(StageSignField, RandomSurfels) {
  for (CameraSetup camera : cameras()) {
    for (const double th_d : {0.4, 0.174}) {
      camera.config.th_d = th_d;
      check(camera, [](const Grid& g, const Limits& limits) {
        Random random(2);
        const int voxels = g.size_i * g.size_j * g.size_k;
        return random_view_surfels(g, limits, std::clamp(voxels / 400, 60, 200), random);
      });
    }
  }
}

TEST(StageSignField, AroundFewCandidates) {
  for (const CameraSetup& camera : cameras()) {
    const MakeSurfels make = [](const Grid& g, const Limits& limits) {
      Random random(4);
      return random_view_surfels(g, limits, 100, random);
    };
    check(camera, make, 0.002);
    check(camera, make, 0);
  }
}

TEST(StageSignField, NoSurfels) {
  for (const CameraSetup& camera : cameras()) check(camera, [](const Grid&, const Limits&) { return std::vector<ViewSurfel>(); });
}

/// Hundreds of surfels in a few voxels: sums beyond 16 bits stay exact.
TEST(StageSignField, Crowd) {
  check(cameras().front(), [](const Grid& g, const Limits& limits) {
    Random random(3);
    std::vector<ViewSurfel> surfels;
    for (int n = 0; n < 400; ++n) {
      const Eigen::Vector3d c(random.uniform(6, 7), random.uniform(6, 7), random.uniform(20, 21));
      const Eigen::Vector3d n_camera = (Eigen::Vector3d(0.55, -0.5, 0.6) + 0.05 * random.direction()).normalized();
      surfels.push_back(make_view_surfel(g, limits, c, n_camera, 2));
    }
    return surfels;
  });
}

/// One surfel at a time across the borders of tiles, words and the grid, along each axis.
TEST(StageSignField, SingleSurfelsAtBorders) {
  const CameraSetup camera = small_tests() ? cameras().front() : cameras()[3];
  const std::vector<double> all = {-2.6, -0.7, 0.2, 7.4, 8.1, 31.6, 32.2, 63.5, 64.3};
  for (int axis = 0; axis < 3; ++axis) {
    for (const double at : small_tests() ? std::vector<double>{-0.7, 7.4, 31.6} : all) {
      SCOPED_TRACE("axis " + std::to_string(axis) + ", at " + std::to_string(at));
      check(camera, [&](const Grid& g, const Limits& limits) {
        Eigen::Vector3d c(6.3, 6.8, 9.1);
        c[axis] = at;
        return std::vector<ViewSurfel>{make_view_surfel(g, limits, c, Eigen::Vector3d(0.5, -0.2, 0.7).normalized(), 1.8)};
      });
    }
  }
}

}  // namespace
}  // namespace frontier_surfels
