/// Boxes that stand or move against slow obvious loops: all their samples by Mapper::states(), and all surfels.
#include "planner_input.hpp"

namespace frontier_surfels {
namespace {

constexpr float kRounding = 2e-5F;  // [m]

/// Points at most `step` apart from `low` to `high`, both included.
std::vector<float> ticks(float low, float high, double step) {
  const int count = std::max(1, static_cast<int>(std::ceil((high - low) / step)));
  std::vector<float> all;
  for (int n = 0; n <= count; ++n) all.push_back(low + (high - low) * (static_cast<float>(n) / static_cast<float>(count)));
  return all;
}

Points samples_of(const Eigen::AlignedBox3f& box, double step) {
  Points points;
  for (const float z : ticks(box.min().z(), box.max().z(), step))
    for (const float y : ticks(box.min().y(), box.max().y(), step))
      for (const float x : ticks(box.min().x(), box.max().x(), step)) points.emplace_back(x, y, z);
  return points;
}

/// The worst of what is there. @param unknown_counts  otherwise what is not occupied is free
SpaceState worst(const std::vector<SpaceState>& states, bool unknown_counts = true) {
  SpaceState all = SpaceState::kFree;
  for (const SpaceState state : states) {
    if (state == SpaceState::kOccupied) return state;
    if (state == SpaceState::kUnknown && unknown_counts) all = state;
  }
  return all;
}

std::vector<SpaceState> of_surfels(const std::vector<Surfel>& surfels, const Eigen::AlignedBox3f& box) {
  std::vector<SpaceState> states;
  for (const Surfel& s : surfels)
    if (box.contains(s.position)) states.push_back(s.label == Label::kOccupied ? SpaceState::kOccupied : SpaceState::kUnknown);
  return states;
}

Eigen::AlignedBox3f box_at(const Eigen::Vector3f& centre, const Eigen::Vector3f& size) { return {centre - size / 2, centre + size / 2}; }

TEST(MapperBoxes, AreTheirSamplesAndSurfels) {
  const std::vector<Surfel> surfels = room_mapper().surfels();
  const Points centres = random_points(300, 21, box_around(surfels)),
               sizes = random_points(300, 22, {Eigen::Vector3f(0.01F, 0.01F, 0.01F), Eigen::Vector3f(0.7F, 0.5F, 0.4F)});
  std::vector<Eigen::AlignedBox3f> boxes;
  for (std::size_t n = 0; n < centres.size(); ++n)
    boxes.push_back(box_at(centres[n], n % 2 == 0 ? sizes[n] : Eigen::Vector3f(sizes[n] / 5)));
  boxes.push_back(box_around(surfels));
  for (const double step : {0.05, 0.13}) {
    const std::vector<SpaceState> states = room_mapper().box_states(boxes, step);
    std::size_t count[3] = {};
    for (std::size_t n = 0; n < boxes.size(); ++n) {
      std::vector<SpaceState> parts = room_mapper().states(samples_of(boxes[n], step));
      for (const SpaceState state : of_surfels(surfels, boxes[n])) parts.push_back(state);
      EXPECT_EQ(states[n], worst(parts)) << n;
      ++count[static_cast<int>(states[n])];
    }
    for (const std::size_t some : count) EXPECT_GT(some, 20U);
  }
}

/// A wall at 2 m, and a thin thing that no sample meets.
class MapperBoxesAtWall : public testing::Test {
 protected:
  MapperBoxesAtWall() { mapper_.integrate(plane_frame(working_camera(), 2).view()); }

  RayState path(const Eigen::Vector3f& from, const Eigen::Vector3f& to, const Eigen::Vector3f& size, bool stop_at_unknown,
                double step = 0.05) {
    return mapper_.path_states({{from, to}}, size, stop_at_unknown, step).front();
  }

  Mapper mapper_{as_recorded()};
};

TEST_F(MapperBoxesAtWall, PathsStopWhereTheBoxTouches) {
  const Eigen::Vector3f size(0.2F, 0.2F, 0.3F);
  const RayState at_wall = path({0, 0, 1}, {0, 0, 5}, size, true), before = path({0, 0, 1}, {0, 0, 1.7F}, size, true),
                 aside = path({0, 0, 1.2F}, {5, 0, 1.2F}, size, true), through = path({0, 0, 5}, {0, 0, 1}, size, false),
                 unknown = path({0, 0, 5}, {0, 0, 1}, size, true);
  EXPECT_EQ(at_wall.state, SpaceState::kOccupied);
  EXPECT_NEAR(at_wall.distance, 2 - 0.15 - 1, 0.05);
  EXPECT_EQ(before.state, SpaceState::kFree);
  EXPECT_FLOAT_EQ(before.distance, 0.7F);
  EXPECT_EQ(aside.state, SpaceState::kUnknown);
  EXPECT_NEAR(aside.distance, 0.5 * 160 / working_camera().fx * 1.05 - 0.1, 0.06);  // the box's near face leaves the view first
  EXPECT_EQ(through.state, SpaceState::kOccupied);
  EXPECT_NEAR(through.distance, 3 - 0.15, 0.05);
  EXPECT_EQ(unknown.state, SpaceState::kUnknown);
  EXPECT_EQ(unknown.distance, 0);
  EXPECT_EQ(path({0, 0, 1.2F}, {0, 0, 1.2F}, size, true).state, SpaceState::kFree);
  EXPECT_EQ(path({0, 0, 2}, {0, 0, 2}, size, true).state, SpaceState::kOccupied);
}

TEST_F(MapperBoxesAtWall, ThinThingsAreFoundBetweenSamples) {
  SavedMap saved = mapper_.saved_map();
  for (const Label label : {Label::kFrontier, Label::kOccupied}) {
    SavedMap with_thing = saved;
    Surfel thing;
    thing.position = {0.0317F, 0.0113F, 1.2271F};
    thing.radius = 0.002F;
    thing.label = label;
    with_thing.surfels.push_back(thing);
    mapper_.load(with_thing);
    const SpaceState expected = label == Label::kOccupied ? SpaceState::kOccupied : SpaceState::kUnknown;
    const Eigen::Vector3f size(0.4F, 0.4F, 0.4F);
    EXPECT_EQ(mapper_.box_states({box_at({0, 0, 1.2F}, size)}, 0.2).front(), expected);
    EXPECT_EQ(mapper_.box_states({box_at({0, 0, 1.6F}, size)}, 0.2).front(), SpaceState::kFree);
    // It comes to the box between two positions, and is found where it is.
    const RayState stop = path({0, 0, 0.8F}, {0, 0, 1.4F}, size, true, 0.4);
    EXPECT_EQ(stop.state, expected);
    EXPECT_NEAR(stop.distance, thing.position.z() - 0.2 - 0.8, 1e-5);
    if (label == Label::kFrontier) {
      EXPECT_EQ(path({0, 0, 0.8F}, {0, 0, 1.4F}, size, false, 0.4).state, SpaceState::kFree);
    }
  }
}

/// Where a path stops, by asking for all at each position.
RayState slow_path(const std::vector<Surfel>& surfels, const Ray& path, const Eigen::Vector3f& size, bool stop_at_unknown, double step) {
  const Eigen::Vector3f way = path.to - path.from;
  const int count = static_cast<int>(std::ceil(way.cast<double>().norm() / step));
  RayState sampled = {SpaceState::kFree, way.norm()};
  for (int n = 0; n <= count && sampled.state == SpaceState::kFree; ++n) {
    const Eigen::Vector3f centre = path.from + way * (count == 0 ? 0 : static_cast<float>(n) / static_cast<float>(count));
    Points points;
    for (const Eigen::Vector3f& p : samples_of(box_at(centre, size), step)) {
      const Eigen::Vector3f ahead = (p - centre).cwiseProduct(way.cwiseSign()) - size / 2;  // 0 on the faces that look ahead
      if (n == 0 || ahead.maxCoeff() > -1e-4F) points.push_back(p);
    }
    const SpaceState state = worst(room_mapper().states(points), stop_at_unknown);
    if (state != SpaceState::kFree) sampled = {state, (centre - path.from).norm()};
  }
  RayState stop = sampled;
  for (const Surfel& s : surfels) {
    const bool occupied = s.label == Label::kOccupied;
    if (!occupied && !stop_at_unknown) continue;
    float begin = 0, end = 1;  // share of the way
    for (int axis = 0; axis < 3; ++axis) {
      const float a = (s.position[axis] - size[axis] / 2 - path.from[axis]) / way[axis],
                  b = (s.position[axis] + size[axis] / 2 - path.from[axis]) / way[axis];
      begin = std::max(begin, std::min(a, b));
      end = std::min(end, std::max(a, b));
    }
    const float distance = begin * way.norm();
    if (begin > end || distance > stop.distance) continue;
    if (distance == stop.distance && !occupied) continue;
    stop = {occupied ? SpaceState::kOccupied : SpaceState::kUnknown, distance};
  }
  return stop;
}

TEST(MapperBoxes, PathsAreTheirPositions) {
  const std::vector<Surfel> surfels = room_mapper().surfels();
  const Points starts = random_points(4000, 23, box_around(surfels));
  const Points ways = random_points(4000, 24, {Eigen::Vector3f::Constant(-0.6F), Eigen::Vector3f::Constant(0.6F)});
  const std::vector<SpaceState> states = room_mapper().states(starts);
  std::vector<Ray> paths;  // most begin in free space
  for (std::size_t n = 0; n < starts.size() && paths.size() < 150; ++n)
    if (states[n] == SpaceState::kFree || n % 100 == 0) paths.push_back({starts[n], starts[n] + ways[n]});
  const Eigen::Vector3f size(0.11F, 0.17F, 0.08F);
  for (const auto& [stop_at_unknown, step] : {std::pair(true, 0.05), std::pair(false, 0.05), std::pair(true, 0.017)}) {
    const std::vector<RayState> stops = room_mapper().path_states(paths, size, stop_at_unknown, step);
    std::size_t count[3] = {}, on_the_way = 0, other = 0;
    for (std::size_t n = 0; n < paths.size(); ++n) {
      const RayState expected = slow_path(surfels, paths[n], size, stop_at_unknown, step);
      other += stops[n].state != expected.state || std::abs(stops[n].distance - expected.distance) > 10 * kRounding;
      ++count[static_cast<int>(expected.state)];
      on_the_way += expected.state != SpaceState::kFree && expected.distance > 0;
    }
    EXPECT_LE(other, 1U) << "of " << paths.size();  // a sample right at a border may be either
    EXPECT_GT(on_the_way, 20U);
    EXPECT_GT(count[static_cast<int>(SpaceState::kOccupied)], 10U);
    EXPECT_GT(count[static_cast<int>(SpaceState::kFree)], 10U);
  }
}

/// Long ways are asked for in several parts.
TEST_F(MapperBoxesAtWall, LongPaths) {
  const RayState stop = path({0, 0, -40}, {0, 0, 40}, {0.1F, 0.1F, 0.1F}, false, 0.02);
  EXPECT_EQ(stop.state, SpaceState::kOccupied);
  EXPECT_NEAR(stop.distance, 41.95, 0.03);
  const RayState missed = path({0, 300, -40}, {0, 300, 40}, {0.1F, 0.1F, 0.1F}, false, 0.5);
  EXPECT_EQ(missed.state, SpaceState::kFree);
  EXPECT_EQ(missed.distance, 80);
}

}  // namespace
}  // namespace frontier_surfels
