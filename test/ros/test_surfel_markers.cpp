/// What a subscriber of ~markers sees, compared with the surfels.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "ros/marker_scene.hpp"
#include "ros/output/surfel_markers.hpp"
#include "ros/surfel_input.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kNoLimit = 10000000;

bool before(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::make_tuple(a.x(), a.y(), a.z()) < std::make_tuple(b.x(), b.y(), b.z());
}

/// Every surfel is shown by exactly one square at its place, and there are no other squares.
void expect_every_surfel(const Scene& scene, const SurfelMirror& map) {
  std::vector<Square> squares = scene.squares();
  std::vector<Surfel> surfels = map.surfels();
  ASSERT_EQ(squares.size(), surfels.size());
  std::sort(squares.begin(), squares.end(), [](const Square& a, const Square& b) { return before(a.center, b.center); });
  std::sort(surfels.begin(), surfels.end(),
            [](const Surfel& a, const Surfel& b) { return before(a.position.cast<double>(), b.position.cast<double>()); });
  for (std::size_t n = 0; n < squares.size(); ++n) {
    const Square& square = squares[n];
    const Surfel& surfel = surfels[n];
    ASSERT_LT((square.center - surfel.position.cast<double>()).norm(), 1e-6);
    EXPECT_EQ(square.label, surfel.label);
    EXPECT_NEAR(square.half_side, surfel.radius, 1e-6);
    EXPECT_LT((square.normal - surfel.normal.cast<double>()).norm(), 1e-4);
    const bool is_colored = surfel.rgb != std::array<std::uint8_t, 3>{0, 0, 0};
    if (surfel.label == Label::kFrontier) {
      EXPECT_GT(square.color.b, square.color.r + 0.3F);
      EXPECT_GT(square.color.b, square.color.g + 0.3F);
    } else if (is_colored) {
      EXPECT_NEAR(255 * square.color.r, surfel.rgb[0], 0.01);
      EXPECT_NEAR(255 * square.color.g, surfel.rgb[1], 0.01);
      EXPECT_NEAR(255 * square.color.b, surfel.rgb[2], 0.01);
    } else {
      EXPECT_TRUE(square.color.r == square.color.g && square.color.g == square.color.b && square.color.r > 0.2F);
    }
  }
}

/// A map, its markers, and what a subscriber sees of them.
struct World {
  explicit World(std::size_t limit) : markers("map", limit) {}

  void apply(const Changes& changes, std::uint64_t since) {
    map.apply(changes, since, [this](const Surfel& surfel, bool comes) { markers.touch(surfel, comes); });
  }
  void apply(std::vector<Surfel> updated, std::vector<std::uint32_t> removed) {
    apply({map.sequence() + 1, std::move(updated), std::move(removed)}, map.sequence());
  }
  MarkerArray update(bool all = false, const std::optional<CameraView>& camera = std::nullopt) {
    MarkerArray message = markers.update(map, camera, ros::Time(12.5), all);
    scene.apply(message, std::max(0.5, markers.cell()));  // blocks are larger if there would be too many cubes of 0.5 m
    return message;
  }

  SurfelMirror map;
  SurfelMarkers markers;
  Scene scene;
};

std::size_t count(const MarkerArray& message, int action, const std::string& ns) {
  return static_cast<std::size_t>(std::count_if(message.markers.begin(), message.markers.end(),
                                                [&](const Marker& marker) { return marker.action == action && marker.ns == ns; }));
}

TEST(SurfelMarkers, ShowEverySurfelAfterAnyChanges) {
  Rng rng(1);
  World world(kNoLimit);
  for (int n = 0; n < 30; ++n) {
    for (int push = 0; push < 5; ++push) world.apply(random_changes(rng, world.map.sequence(), 4000, 150), world.map.sequence());
    const MarkerArray message = world.update();
    expect_every_surfel(world.scene, world.map);
    EXPECT_EQ(world.markers.squares(), world.map.size());
    EXPECT_EQ(world.markers.cell(), 0);
    for (const Marker& marker : message.markers) EXPECT_EQ(marker.header.stamp, ros::Time(12.5));
    EXPECT_EQ(message.markers.front().action == Marker::DELETEALL, n == 0);
  }
}

TEST(SurfelMarkers, SendOnlyBlocksThatWereTouched) {
  Rng rng(2);
  World world(kNoLimit);
  world.apply({1, random_surfels(rng, 20000), {}}, 0);
  const std::size_t all = world.update().markers.size();
  ASSERT_GT(all, 500U);

  Surfel moved = *world.map.slots().find(77);
  moved.position = 0.99F * world.map.slots().find(78)->position;
  world.apply({moved}, {});
  const MarkerArray message = world.update();
  EXPECT_LE(message.markers.size(), 4U + 1U);  // two blocks with two labels each, and the numbers of surfels
  EXPECT_GE(message.markers.size(), 2U + 1U);
  expect_every_surfel(world.scene, world.map);

  EXPECT_EQ(world.update().markers.size(), 1U);
}

TEST(SurfelMarkers, KeepABlocksId) {
  Rng rng(3);
  World world(kNoLimit);
  const auto surfels = random_surfels(rng, 3000, 0.6F);
  world.apply({1, surfels, {}}, 0);
  const MarkerArray first = world.update();
  world.apply(surfels, {});
  const MarkerArray second = world.update();
  ASSERT_EQ(second.markers.size() + 1, first.markers.size());
  for (std::size_t n = 0; n < second.markers.size(); ++n) {
    EXPECT_EQ(second.markers[n].ns, first.markers[n + 1].ns);
    EXPECT_EQ(second.markers[n].id, first.markers[n + 1].id);
  }
}

TEST(SurfelMarkers, OfEmptiedBlocksAreDeleted) {
  Rng rng(4);
  World world(kNoLimit);
  world.apply({1, random_surfels(rng, 5000), {}}, 0);
  world.update();
  std::vector<std::uint32_t> gone;
  std::vector<Surfel> relabelled;
  for (Surfel surfel : world.map.surfels()) {
    surfel.label = Label::kOccupied;
    if (surfel.position.x() > 0)
      gone.push_back(surfel.id);
    else
      relabelled.push_back(surfel);
  }
  world.apply(relabelled, gone);
  const MarkerArray message = world.update();
  EXPECT_GT(count(message, Marker::DELETE, "occupied"), 50U);
  EXPECT_GT(count(message, Marker::DELETE, "frontier"), 100U);
  expect_every_surfel(world.scene, world.map);

  world.apply({world.map.sequence() + 1, {}, {}}, 0);
  world.update();
  EXPECT_TRUE(world.scene.squares().empty());
  EXPECT_EQ(world.markers.squares(), 0U);
}

TEST(SurfelMarkers, ComeAllAgainWhenAskedFor) {
  Rng rng(5);
  World world(kNoLimit);
  world.apply({1, random_surfels(rng, 5000), {}}, 0);
  world.update();
  std::vector<std::uint32_t> gone;  // whole blocks become empty at the same time
  for (const Surfel& surfel : world.map.surfels())
    if (surfel.position.x() > 0) gone.push_back(surfel.id);
  world.apply({}, gone);
  Scene newcomer;
  newcomer.apply(world.update(true));
  expect_every_surfel(newcomer, world.map);
  expect_every_surfel(world.scene, world.map);

  world.markers.forget();
  world.apply({random_surfel(rng, 20)}, {21});
  Scene later;
  later.apply(world.update());
  expect_every_surfel(later, world.map);
}

/// Three walls and a floor of surfels 1 cm apart. Each of them has one label and one colour.
std::vector<Surfel> walls() {
  std::vector<Surfel> surfels;
  for (int wall = 0; wall < 4; ++wall) {
    for (int i = 0; i < 60; ++i) {
      for (int j = 0; j < 60; ++j) {
        const float u = 0.01F * static_cast<float>(i), v = 0.01F * static_cast<float>(j);
        Surfel surfel;
        surfel.position = wall == 0 ? Eigen::Vector3f(u, v, 0.1F) : wall == 1 ? Eigen::Vector3f(u, 1.2F, v) : Eigen::Vector3f(-0.3F, u, v);
        if (wall == 3) surfel.position.x() = 1;
        surfel.normal = wall == 0 ? Eigen::Vector3f(0, 0, 1) : wall == 1 ? Eigen::Vector3f(0, -1, 0) : Eigen::Vector3f(1, 0, 0);
        surfel.radius = 0.007F;
        surfel.label = wall < 2 ? Label::kOccupied : Label::kFrontier;
        surfel.rgb = {static_cast<std::uint8_t>(10 * wall + 100), 50, 60};
        surfel.id = static_cast<std::uint32_t>(surfels.size());
        surfels.push_back(surfel);
      }
    }
  }
  return surfels;
}

TEST(MergedSquares, CoverTheSurfels) {
  for (const std::size_t limit : {10000, 3000, 600, 100}) {
    World world(limit);
    world.apply({1, walls(), {}}, 0);
    world.update();
    const auto squares = world.scene.squares();
    EXPECT_GT(world.markers.cell(), 0);
    EXPECT_LE(squares.size(), limit);
    EXPECT_GT(8 * squares.size(), limit) << "smaller cubes would keep the limit as well";
    for (const Surfel& surfel : world.map.surfels()) {
      double nearest = 1;
      for (const Square& square : squares)
        if (square.label == surfel.label && nearest > 0) nearest = std::min(nearest, distance(surfel, square));
      ASSERT_LE(nearest, 0.0051) << "limit " << limit << ", surfel at " << surfel.position.transpose();  // half the distance of two surfels
    }
  }
}

/// With a lattice of surfels that are half an edge apart, a limit one below their number needs cubes of that edge.
TEST(MergedSquares, AreOneACube) {
  for (const float edge : {1 / 128.0F, 1 / 64.0F, 1 / 16.0F, 0.5F, 1.0F, 8.0F}) {
    std::vector<Surfel> surfels(1000);
    for (std::uint32_t id = 0; id < surfels.size(); ++id) {
      const Eigen::Vector3f cell(static_cast<float>(id % 10), static_cast<float>(id / 10 % 10), static_cast<float>(id / 100));
      surfels[id].position = edge / 2 * (cell - Eigen::Vector3f::Constant(3)) + Eigen::Vector3f::Constant(0.001F);
      surfels[id].radius = 0.001F;
      surfels[id].id = id;
    }
    World world(surfels.size() - 1);
    world.apply({1, surfels, {}}, 0);
    world.update();
    EXPECT_EQ(world.markers.cell(), edge);
    EXPECT_GE(world.markers.squares(), 5U * 5 * 5);
    EXPECT_LE(world.markers.squares(), 6U * 6 * 6);
  }
}

TEST(MergedSquares, KeepLabelsAndDirectionsApart) {
  Rng rng(11);
  std::vector<Surfel> surfels = random_surfels(rng, 3000, 0.01F);
  for (Surfel& surfel : surfels) {
    const int kind = static_cast<int>(surfel.id % 12);
    surfel.label = kind < 6 ? Label::kFrontier : Label::kOccupied;
    surfel.normal = (kind % 2 == 0 ? 1 : -1) * Eigen::Vector3f::Unit(kind / 2 % 3) + 0.3F * surfel.normal;
    surfel.normal.normalize();
  }
  World world(100);
  world.apply({1, surfels, {}}, 0);
  world.update();
  std::map<std::pair<Label, int>, int> kinds;
  for (const Square& square : world.scene.squares()) {
    int axis;
    EXPECT_GT(square.normal.cwiseAbs().maxCoeff(&axis), 0.95);
    ++kinds[{square.label, square.normal[axis] > 0 ? axis : axis + 3}];
  }
  EXPECT_EQ(kinds.size(), 12U);
}

TEST(MergedSquares, HaveTheMeansOfTheirSurfels) {
  World world(100);
  world.apply({1, walls(), {}}, 0);
  world.update();
  for (const Square& square : world.scene.squares()) {
    EXPECT_NEAR(square.half_side, world.markers.cell() / 2, 1e-6);
    EXPECT_NEAR(square.normal.cwiseAbs().maxCoeff(), 1, 1e-6);
    if (square.label != Label::kOccupied) continue;
    EXPECT_NEAR(255 * square.color.r, square.normal.z() > 0.5 ? 100 : 110, 0.01);
    EXPECT_NEAR(255 * square.color.g, 50, 0.01);
  }
}

TEST(MergedSquares, AreBoundedInNumberWhateverTheMap) {
  Rng rng(6);
  for (const std::size_t limit : {100, 130, 700, 4999, 5000}) {
    World world(limit);
    world.apply({1, random_surfels(rng, 5000, 10), {}}, 0);
    world.update();
    const auto squares = world.scene.squares();
    EXPECT_LE(squares.size(), limit);
    EXPECT_EQ(squares.size(), world.markers.squares());
    EXPECT_EQ(world.markers.cell() == 0, limit == 5000);
    const double reach = world.markers.cell() * std::sqrt(3) + 1e-5;
    for (const Surfel& surfel : world.map.surfels()) {
      double nearest = 1e9;
      for (const Square& square : squares)
        if (square.label == surfel.label) nearest = std::min(nearest, (square.center - surfel.position.cast<double>()).norm());
      ASSERT_LE(nearest, reach) << "limit " << limit;
    }
  }
}

TEST(MergedSquares, GrowAndShrinkWithTheMap) {
  Rng rng(7);
  World world(3000);
  std::vector<double> cells;
  std::uint32_t ids = 0;
  for (; ids < 24000; ids += 2000) {
    std::vector<Surfel> more = random_surfels(rng, 2000);
    for (Surfel& surfel : more) surfel.id += ids;
    world.apply(more, {});
    const double cell = world.markers.cell();
    const MarkerArray message = world.update();
    EXPECT_EQ(message.markers.front().action == Marker::DELETEALL, ids == 0 || cell != world.markers.cell());
    EXPECT_EQ(world.scene.squares().size(), world.markers.squares());
    EXPECT_LE(world.markers.squares(), 3000U);
    cells.push_back(world.markers.cell());
  }
  EXPECT_TRUE(std::is_sorted(cells.begin(), cells.end()));
  EXPECT_GT(cells.back(), 0.1);
  while (ids > 0) {
    std::vector<std::uint32_t> gone;
    for (int n = 0; n < 1000; ++n) gone.push_back(--ids);
    world.apply({}, gone);
    world.update();
    EXPECT_EQ(world.scene.squares().size(), world.markers.squares());
    EXPECT_LE(world.markers.squares(), 3000U);
    if (ids == 2000) expect_every_surfel(world.scene, world.map);
  }
  EXPECT_TRUE(world.scene.squares().empty());
}

TEST(MergedSquares, AreTheSameAfterChangesAsFromTheStart) {
  Rng rng(8);
  World world(1500);
  world.apply({1, random_surfels(rng, 6000), {}}, 0);
  for (int n = 0; n < 10; ++n) {
    world.update();
    for (int push = 0; push < 3; ++push) world.apply(random_changes(rng, world.map.sequence(), 6000, 100), world.map.sequence());
  }
  world.update();
  World fresh(1500);
  fresh.apply({1, world.map.surfels(), {}}, 0);
  fresh.update();
  ASSERT_EQ(fresh.markers.cell(), world.markers.cell());
  auto a = world.scene.squares(), b = fresh.scene.squares();
  ASSERT_EQ(a.size(), b.size());
  for (auto* squares : {&a, &b})
    std::sort(squares->begin(), squares->end(), [](const Square& x, const Square& y) { return before(x.center, y.center); });
  for (std::size_t n = 0; n < a.size(); ++n) {
    EXPECT_EQ(a[n].center, b[n].center);
    EXPECT_EQ(a[n].label, b[n].label);
    EXPECT_EQ(a[n].corner, b[n].corner);
  }
}

TEST(SurfelMarkers, StandPositionsThatCannotBe) {
  Rng rng(9);
  World world(1000);
  auto surfels = random_surfels(rng, 10);
  surfels[0].position.x() = std::numeric_limits<float>::quiet_NaN();
  surfels[1].position.y() = std::numeric_limits<float>::infinity();
  surfels[2].position.z() = -std::numeric_limits<float>::max();
  surfels[3].normal.setZero();
  surfels[4].normal.setConstant(std::numeric_limits<float>::quiet_NaN());
  world.apply({1, surfels, {}}, 0);
  EXPECT_NO_THROW(world.markers.update(world.map, std::nullopt, ros::Time(), false));
  EXPECT_EQ(world.markers.squares(), 10U);
}

TEST(ViewPyramid, StandsWhereTheCameraLooks) {
  World world(1000);
  Rng rng(10);
  world.apply({1, random_surfels(rng, 100), {}}, 0);
  CameraView camera;
  EXPECT_EQ(world.update(false, camera).markers.back().ns, "counts") << "no camera is known";
  EXPECT_EQ(world.scene.find("camera", 0), nullptr);

  camera.T_world_camera = Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitY());  // looks along x
  camera.intrinsics = {100, 100, 79.5, 59.5, 160, 120};
  for (const double z_max : {3.0, 0.2}) {
    camera.z_max = z_max;
    const double depth = std::min(z_max, 0.5);
    world.update(false, camera);
    const Marker* lines = world.scene.find("camera", 0);
    ASSERT_NE(lines, nullptr);
    EXPECT_EQ(lines->type, Marker::LINE_LIST);
    ASSERT_EQ(lines->points.size(), 16U);
    int at_apex = 0;
    for (const auto& point : lines->points) {
      const Eigen::Vector3d p = to_vector(point) - Eigen::Vector3d(1, 2, 3);
      at_apex += p.norm() < 1e-9;
      if (p.norm() < 1e-9) continue;
      EXPECT_NEAR(p.x(), depth, 1e-9);
      EXPECT_NEAR(std::abs(p.z()), 0.8 * depth, 1e-9);
      EXPECT_NEAR(std::abs(p.y()), 0.6 * depth, 1e-9);
    }
    EXPECT_EQ(at_apex, 4);
  }
  const Marker* text = world.scene.find("counts", 0);
  ASSERT_NE(text, nullptr);
  EXPECT_EQ(text->type, Marker::TEXT_VIEW_FACING);
  EXPECT_NE(text->text.find(std::to_string(world.map.occupied()) + " occupied"), std::string::npos);
  EXPECT_NE(text->text.find(std::to_string(100 - world.map.occupied()) + " frontier"), std::string::npos);
  EXPECT_GT(text->pose.position.z, 3);
  EXPECT_GT(text->scale.z, 0);

  world.update();
  EXPECT_EQ(world.scene.find("camera", 0), nullptr) << "the camera is not known any more";
}

}  // namespace
}  // namespace frontier_surfels
