/// The boundary near points, and boxes that stand or move, against slow obvious loops over all surfels and all samples.
#include "planner_input.hpp"

namespace frontier_surfels {
namespace {

constexpr float kRounding = 2e-5F;  // [m], also far from the origin of a room

/// Compares an answer with all surfels. Where another surfel is as near but for rounding, either will do.
void expect_nearest(const NearestBoundary& found, const Eigen::Vector3f& p, double reach, const std::vector<Surfel>& surfels) {
  const Surfel *nearest = nullptr, *named = nullptr;
  for (const Surfel& s : surfels) {
    if (nearest == nullptr || (s.position - p).norm() < (nearest->position - p).norm()) nearest = &s;
    if (s.id == found.id) named = &s;
  }
  const float distance = nearest == nullptr ? 1e9F : (nearest->position - p).norm();
  if (found.id == NearestBoundary::kNone) {
    EXPECT_GT(distance, reach - kRounding);
    EXPECT_TRUE(std::isinf(found.distance));
    EXPECT_FALSE(found.in_front);
    return;
  }
  ASSERT_NE(named, nullptr);
  EXPECT_LE(found.distance, reach + kRounding);
  EXPECT_NEAR(found.distance, distance, kRounding);
  EXPECT_NEAR(found.distance, (named->position - p).norm(), kRounding);
  EXPECT_EQ(found.label, named->label);
  const float height = (p - named->position).dot(named->normal);
  if (std::abs(height) > kRounding) {
    EXPECT_EQ(found.in_front, height > 0);
  }
}

TEST(MapperBoundaries, NearestAreThoseOfAllSurfels) {
  const std::vector<Surfel> surfels = room_mapper().surfels();
  Points points = random_points(400, 11, box_around(surfels));
  points.push_back(surfels.front().position);
  points.push_back(box_around(surfels).max() + Eigen::Vector3f::Constant(30));
  for (const double reach : {0.001, 0.07, 0.5, 2.6, 5.0}) {
    const std::vector<NearestBoundary> nearest = room_mapper().nearest_boundaries(points, reach);
    ASSERT_EQ(nearest.size(), points.size());
    for (std::size_t n = 0; n < points.size(); ++n) expect_nearest(nearest[n], points[n], reach, surfels);
    const auto near = std::count_if(nearest.begin(), nearest.end(), [](const NearestBoundary& b) { return std::isfinite(b.distance); });
    EXPECT_GE(near, reach < 0.01 ? 1 : reach < 0.1 ? 20 : 200) << reach;
  }
}

/// A few points are answered in another way than many, with the same answers.
TEST(MapperBoundaries, FewPointsGetTheAnswersOfMany) {
  const Points points = random_points(3000, 14, box_around(room_mapper().surfels()));
  for (const double reach : {0.05, 0.7, 5.0}) {
    const std::vector<NearestBoundary> of_many = room_mapper().nearest_boundaries(points, reach);
    for (std::size_t n = 0; n + 2 < 120; n += 3) {
      const std::vector<NearestBoundary> of_few = room_mapper().nearest_boundaries({points[n], points[n + 1], points[n + 2]}, reach);
      for (std::size_t m = 0; m < 3; ++m) {
        EXPECT_EQ(of_few[m].id, of_many[n + m].id);
        EXPECT_EQ(of_few[m].in_front, of_many[n + m].in_front);
        EXPECT_EQ(of_few[m].label, of_many[n + m].label);
        if (of_few[m].id == NearestBoundary::kNone) continue;
        EXPECT_NEAR(of_few[m].distance, of_many[n + m].distance, 1e-6F);
      }
    }
  }
}

/// Points of free space are in front of their nearest surfel. At the rims of sheets of frontier, some are behind one that looks past them.
TEST(MapperBoundaries, FreeSpaceIsInFront) {
  const Points points = random_points(5000, 12, box_around(room_mapper().surfels()));
  const std::vector<NearestBoundary> nearest = room_mapper().nearest_boundaries(points, 1);
  const std::vector<SpaceState> states = room_mapper().states(points);
  std::size_t behind = 0, free[2] = {}, free_in_front[2] = {};  // the latter by label
  for (std::size_t n = 0; n < points.size(); ++n) {
    if (nearest[n].id == NearestBoundary::kNone) continue;
    behind += !nearest[n].in_front;
    if (states[n] != SpaceState::kFree) continue;
    ++free[static_cast<int>(nearest[n].label)];
    free_in_front[static_cast<int>(nearest[n].label)] += nearest[n].in_front;
  }
  EXPECT_GT(behind, 500U);
  for (const Label label : {Label::kFrontier, Label::kOccupied}) {
    const auto at = static_cast<int>(label);
    EXPECT_GT(free[at], 200U);
    EXPECT_GE(free_in_front[at], (label == Label::kOccupied ? 0.99 : 0.9) * free[at]) << free[at] << " of label " << at;
  }
}

Surfel surfel_at(const Eigen::Vector3f& position, Label label = Label::kOccupied) {
  Surfel surfel;
  surfel.position = position;
  surfel.radius = 0.01F;
  surfel.label = label;
  return surfel;
}

/// Of surfels as near as each other, the lowest id; whatever is around, and at the borders of cells, blocks and regions.
TEST(MapperBoundaries, TiesAndBorders) {
  for (const Eigen::Vector3f& at : {Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(4, -4, 0.5F), Eigen::Vector3f(-100.25F, 3, 8)}) {
    std::vector<Surfel> surfels;
    for (int n = 0; n < 70; ++n) surfels.push_back(surfel_at(at + Eigen::Vector3f(0, 0, 0.25F)));
    for (int axis = 0; axis < 3; ++axis) surfels.push_back(surfel_at(at + 0.5F * Eigen::Vector3f::Unit(axis), Label::kFrontier));
    Mapper mapper(as_recorded());
    mapper.load(surfels);
    const std::vector<Surfel> all = mapper.surfels();
    const Points points = {at, at + Eigen::Vector3f(0, 0, 0.25F), at + Eigen::Vector3f(0, 0, 0.5F)};
    std::vector<NearestBoundary> nearest = mapper.nearest_boundaries(points, 1);
    for (std::size_t n = 0; n < points.size(); ++n) expect_nearest(nearest[n], points[n], 1, all);
    std::uint32_t lowest = NearestBoundary::kNone;
    for (const Surfel& s : all)
      if (s.label == Label::kOccupied) lowest = std::min(lowest, s.id);
    EXPECT_EQ(nearest[0].id, lowest);
    EXPECT_FALSE(nearest[0].in_front);
    EXPECT_TRUE(mapper.nearest_boundaries({at + Eigen::Vector3f(0, 0, 0.3F)}, 1).front().in_front);
    EXPECT_EQ(mapper.nearest_boundaries({at}, 0.2).front().id, NearestBoundary::kNone);
  }
}

TEST(MapperBoundaries, DoNotDependOnWidthThreadsAndCompany) {
  const Frames frames = orbit_frames(coarse_camera(), 8, 10);
  std::vector<std::vector<NearestBoundary>> all;
  std::vector<std::vector<RayState>> paths;
  for (const auto& [lanes, threads] : {std::pair(16, 2), std::pair(16, 1), std::pair(1, 2)}) {
    Config config = as_recorded();
    config.lanes = lanes;
    config.threads = threads;
    Mapper mapper(config);
    integrate_all(mapper, frames);
    const Points points = random_points(1001, 13, box_around(mapper.surfels()));
    all.push_back(mapper.nearest_boundaries(points, 0.5));
    std::vector<Ray> ways;
    for (std::size_t n = 0; n < 100; n += 2) ways.push_back({points[n], points[n + 1]});
    paths.push_back(mapper.path_states(ways, {0.1F, 0.2F, 0.1F}, false));
    for (std::size_t n = 0; n < points.size(); n += 97) {
      const NearestBoundary alone = mapper.nearest_boundaries({points[n]}, 0.5).front();
      EXPECT_EQ(alone.id, all.back()[n].id);
      if (alone.id != NearestBoundary::kNone) {
        EXPECT_NEAR(alone.distance, all.back()[n].distance, kRounding);
      }
    }
  }
  for (const int other : {1, 2}) {
    for (std::size_t n = 0; n < all[0].size(); ++n) {
      EXPECT_EQ(all[0][n].id, all[other][n].id);
      EXPECT_EQ(all[0][n].distance, all[other][n].distance);
      EXPECT_EQ(all[0][n].in_front, all[other][n].in_front);
    }
    for (std::size_t n = 0; n < paths[0].size(); ++n) {
      EXPECT_EQ(paths[0][n].state, paths[other][n].state);
      EXPECT_EQ(paths[0][n].distance, paths[other][n].distance);
    }
  }
}

TEST(MapperBoundaries, ClearanceIsTheDistanceOfFreePoints) {
  const Points points = random_points(3000, 14, box_around(room_mapper().surfels()));
  const std::vector<float> clearance = room_mapper().clearance(points, 0.15);
  const std::vector<SpaceState> states = room_mapper().states(points);
  const std::vector<NearestBoundary> nearest = room_mapper().nearest_boundaries(points, 5);
  std::size_t most = 0, less = 0;
  for (std::size_t n = 0; n < points.size(); ++n) {
    const float expected = states[n] == SpaceState::kFree ? std::min(nearest[n].distance, 0.15F) : 0.0F;
    EXPECT_NEAR(clearance[n], expected, kRounding);
    most += expected == 0.15F;
    less += expected > 0 && expected < 0.15F;
  }
  EXPECT_GT(most, 100U);
  EXPECT_GT(less, 100U);
}

TEST(MapperBoundaries, OfAnEmptyMapAndOfNothing) {
  const Mapper mapper(as_recorded());
  EXPECT_TRUE(mapper.nearest_boundaries({}, 1).empty());
  EXPECT_TRUE(mapper.clearance({}, 1).empty());
  EXPECT_TRUE(mapper.box_states({}).empty());
  EXPECT_TRUE(mapper.path_states({}, {1, 1, 1}, true).empty());
  EXPECT_EQ(mapper.nearest_boundaries({Eigen::Vector3f(1e30F, 0, 0), Eigen::Vector3f(1, 2, 3)}, 1).back().id, NearestBoundary::kNone);
  EXPECT_EQ(mapper.clearance({Eigen::Vector3f(1, 2, 3)}, 1), std::vector<float>{0});
  const Eigen::AlignedBox3f box(Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(1, 1, 1));
  EXPECT_EQ(mapper.box_states({box}), std::vector<SpaceState>{SpaceState::kUnknown});
  EXPECT_EQ(mapper.path_states({{{0, 0, 0}, {1, 0, 0}}}, {1, 1, 1}, true).front().state, SpaceState::kUnknown);
  EXPECT_EQ(mapper.path_states({{{0, 0, 0}, {1, 0, 0}}}, {1, 1, 1}, false).front().distance, 1);
}

TEST(MapperBoundaries, WhatMakesNoSenseIsRefused) {
  const Mapper& mapper = room_mapper();
  const Eigen::Vector3f origin(0, 0, 0), nowhere(0, std::nanf(""), 0);
  EXPECT_EQ(fault_of<Error>([&] {
              mapper.nearest_boundaries({origin, nowhere}, 1);
            }),
            "Point 1 is not finite, so that nothing is near it.");
  EXPECT_EQ(fault_of<Error>([&] { mapper.nearest_boundaries({origin}, 6); }), "The reach is 6 m: it must be from 0.001 to 5 m.");
  for (const double reach : {0.0, -1.0, 1e-4, std::nan("")}) EXPECT_THROW(mapper.clearance({origin}, reach), Error);

  const Eigen::AlignedBox3f unit(origin, Eigen::Vector3f::Ones()), flat(origin, Eigen::Vector3f(1, 0, 1)),
      large(origin, Eigen::Vector3f(1, 1, 20.5F)), open(origin, nowhere), hall(origin, Eigen::Vector3f::Constant(20));
  EXPECT_EQ(fault_of<Error>([&] {
              mapper.box_states({unit, flat});
            }),
            "Box 1 is 1 x 0 x 1 m large: each edge must be longer than 0, and at most 20 m.");
  EXPECT_THROW(mapper.box_states({large}), Error);
  EXPECT_THROW(mapper.box_states({Eigen::AlignedBox3f()}), Error);
  EXPECT_EQ(fault_of<Error>([&] { mapper.box_states({open}); }), "Box 0 has a corner that is not finite.");
  EXPECT_EQ(fault_of<Error>([&] {
              mapper.box_states({hall, hall});
            }),
            "A step of 0.05 m makes more than 100 million samples: choose a larger one, or ask for less at once.");
  for (const double step : {0.0, 2.0, std::nan("")}) EXPECT_THROW(mapper.box_states({unit}, step), Error);

  const Ray way = {origin, Eigen::Vector3f(1, 0, 0)}, endless = {origin, nowhere}, far = {origin, Eigen::Vector3f(2e5F, 0, 0)};
  EXPECT_EQ(fault_of<Error>([&] { mapper.path_states({way, endless}, {1, 1, 1}, true); }), "Path 1 has an end that is not finite.");
  EXPECT_EQ(fault_of<Error>([&] { mapper.path_states({far}, {1, 1, 1}, true); }), "Path 0 is 200000 m long, too much for steps of 0.05 m.");
  EXPECT_EQ(fault_of<Error>([&] {
              mapper.path_states({way}, {1, -1, 1}, true);
            }),
            "The box on the paths is 1 x -1 x 1 m large: each edge must be longer than 0, and at most 20 m.");
  EXPECT_THROW(mapper.path_states({way}, nowhere, true), Error);
  EXPECT_THROW(mapper.path_states({way}, {1, 1, 1}, true, 0), Error);
  EXPECT_THROW(mapper.path_states(std::vector<Ray>(3, {origin, Eigen::Vector3f(1e4F, 0, 0)}), {20, 20, 20}, true), Error);
}

}  // namespace
}  // namespace frontier_surfels
