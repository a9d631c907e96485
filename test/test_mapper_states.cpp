/// States of points against the slow obvious answer: the exact test of the frames, and the distances to all occupied surfels.
#include "planner_input.hpp"

namespace frontier_surfels {
namespace {

bool is_occupied(const std::vector<Surfel>& surfels, const Eigen::Vector3f& p) {
  return std::any_of(surfels.begin(), surfels.end(), [&](const Surfel& surfel) {
    return surfel.label == Label::kOccupied && (surfel.position - p).norm() <= surfel.radius / kNewRadius;
  });
}

scoring::ExactTest test_of(const Frames& frames, const Config& config) {
  scoring::ExactTest test(config);
  for (const auto& frame : frames) test.add(frame.view());
  return test;
}

/// Is all within `distance` of a point alike to the frames?
bool is_clear(const scoring::ExactTest& test, const Eigen::Vector3f& p, double distance) {
  const bool known = test.known(p.cast<double>());
  for (int n = 0; n < 27; ++n)
    if (test.known(p.cast<double>() + distance * Eigen::Vector3d(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)) != known) return false;
  return true;
}

TEST(MapperStates, KeptViewsKnowExactly) {
  const Frames frames = orbit_frames(coarse_camera(), 30, 5);
  Mapper mapper(as_recorded());
  integrate_all(mapper, frames);
  const std::vector<Surfel> surfels = mapper.surfels();
  const Points points = random_points(20000, 1, box_around(surfels));
  const std::vector<SpaceState> states = mapper.states(points);
  ASSERT_EQ(states.size(), points.size());
  const scoring::ExactTest test = test_of(frames, as_recorded());
  std::size_t wrong = 0, count[3] = {};
  for (std::size_t n = 0; n < points.size(); ++n) {
    const SpaceState expected = is_occupied(surfels, points[n])        ? SpaceState::kOccupied
                                : test.known(points[n].cast<double>()) ? SpaceState::kFree
                                                                       : SpaceState::kUnknown;
    wrong += states[n] != expected;
    ++count[static_cast<int>(states[n])];
  }
  EXPECT_LE(wrong, 10u);  // depths are kept in steps: points right at a surface, and at a pixel's edge, may differ
  for (const std::size_t some : count) EXPECT_GT(some, 500u);
}

/// Most views are forgotten: seen points know what they knew.
TEST(MapperStates, ForgottenViewsAreRememberedAwayFromTheBoundary) {
  const Frames frames = orbit_frames(coarse_camera(), 60, 3);
  Config config = as_recorded();
  config.recent_views = 5;
  Mapper mapper(config);
  integrate_all(mapper, frames);
  const std::vector<Surfel> surfels = mapper.surfels();
  const Points points = random_points(20000, 2, box_around(surfels));
  const std::vector<SpaceState> states = mapper.states(points);
  const scoring::ExactTest test = test_of(frames, config);
  const double two_voxels = 2 * config.z_max / coarse_camera().fx;
  std::size_t asked = 0, right = 0;
  for (std::size_t n = 0; n < points.size(); ++n) {
    if (states[n] == SpaceState::kOccupied || !is_clear(test, points[n], two_voxels)) continue;
    ++asked;
    right += (states[n] == SpaceState::kFree) == test.known(points[n].cast<double>());
  }
  EXPECT_GT(asked, 10000u);
  EXPECT_GE(right, asked * 0.998) << asked - right << " of " << asked;
}

/// Deep in what is solid nothing is free, be it by kept views or by seen points, and with a Kinect's noise.
TEST(MapperStates, SolidsAreNotFree) {
  const replay::Room room;
  for (const bool noise : {false, true}) {
    replay::SensorModel sensor;
    sensor.noise = noise;
    Config config = as_recorded();
    config.recent_views = 8;
    Mapper mapper(config);
    for (int n = 0; n < 25; ++n) mapper.integrate(room.render(8 * n, 200, working_camera(), sensor, replay::CameraPath::kExplore).view());
    const Points points = random_points(300000, 7, box_around(mapper.surfels()));
    const std::vector<SpaceState> states = mapper.states(points);
    const double depth = noise ? 0.04 : 0.02;  // without decimation, single pixels may err by several deviations, of 1.3 cm each at 3 m
    std::size_t deep = 0, deep_free = 0, shallow_free = 0, before = 0, before_free = 0;
    for (std::size_t n = 0; n < points.size(); ++n) {
      const double distance = room.distance(points[n].cast<double>());
      deep += distance < -depth;
      deep_free += distance < -depth && states[n] == SpaceState::kFree;
      shallow_free += distance < 0 && distance > -depth && states[n] == SpaceState::kFree;
      before += distance > 0.05 && distance < 0.3;
      before_free += distance > 0.05 && distance < 0.3 && states[n] == SpaceState::kFree;
    }
    EXPECT_GT(deep, 3000U);
    EXPECT_LE(deep_free, 1e-4 * deep) << "of " << deep;
    EXPECT_GT(shallow_free, 0U);                              // so that this test can fail
    EXPECT_GT(before_free, 0.3 * before) << "of " << before;  // the free space around is known
  }
}

TEST(MapperStates, DoNotDependOnWidthAndThreads) {
  const Frames frames = orbit_frames(coarse_camera(), 20, 5);
  std::vector<std::vector<SpaceState>> all;
  for (const auto& [lanes, threads] : {std::pair(16, 2), std::pair(16, 1), std::pair(1, 2)}) {
    Config config = as_recorded();
    config.recent_views = 8;
    config.lanes = lanes;
    config.threads = threads;
    Mapper mapper(config);
    integrate_all(mapper, frames);
    all.push_back(mapper.states(random_points(3001, 3, box_around(mapper.surfels()))));
  }
  EXPECT_EQ(all[0], all[1]);
  EXPECT_EQ(all[0], all[2]);
}

/// The order of the points, and what is asked beside them, change nothing.
TEST(MapperStates, EachPointIsAskedForItself) {
  const Frames frames = orbit_frames(coarse_camera(), 10, 10);
  Mapper mapper(as_recorded());
  integrate_all(mapper, frames);
  Points points = random_points(500, 4, box_around(mapper.surfels()));
  points.push_back(points.front());
  const std::vector<SpaceState> states = mapper.states(points);
  for (std::size_t n = 0; n < points.size(); n += 7) EXPECT_EQ(mapper.states({points[n]}).front(), states[n]);
}

/// Far from the origin, on all sides of it, and beyond everything.
TEST(MapperStates, AnywhereInTheWorld) {
  for (const Eigen::Vector3d& at : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(-1000.3, 2000.7, -30)}) {
    Mapper mapper(as_recorded());
    mapper.integrate(plane_frame(working_camera(), 2, Eigen::Isometry3d(Eigen::Translation3d(at))).view());
    const Eigen::Vector3f eye = at.cast<float>();
    const auto along_axis = [&](float z) { return Eigen::Vector3f(eye + Eigen::Vector3f(0, 0, z)); };
    const std::vector<SpaceState> states =
        mapper.states({along_axis(-0.5F), along_axis(1), along_axis(1.9F), along_axis(2.005F), along_axis(2.2F),
                       eye + Eigen::Vector3f(50, 0, 0), Eigen::Vector3f(-3e6F, 0, 0), Eigen::Vector3f(1e30F, 0, 0)});
    EXPECT_EQ(states, (std::vector<SpaceState>{SpaceState::kUnknown, SpaceState::kFree, SpaceState::kFree, SpaceState::kOccupied,
                                               SpaceState::kUnknown, SpaceState::kUnknown, SpaceState::kUnknown, SpaceState::kUnknown}));
  }
}

/// A loaded surfel may reach beyond the blocks around its own, whichever points are asked together.
TEST(MapperStates, LargeSurfelsReachFar) {
  Surfel surfel;
  surfel.position = {0.3F, 0.2F, 0.1F};
  surfel.radius = 1;
  surfel.label = Label::kOccupied;
  Mapper mapper(as_recorded());
  mapper.load({surfel});
  Points within, beyond;
  for (int axis = 0; axis < 3; ++axis)
    for (const float sign : {-1.0F, 1.0F}) {
      within.push_back(surfel.position + sign * 1.1F * Eigen::Vector3f::Unit(axis));
      beyond.push_back(surfel.position + sign * 1.2F * Eigen::Vector3f::Unit(axis));
    }
  EXPECT_EQ(mapper.states(within), std::vector<SpaceState>(within.size(), SpaceState::kOccupied));
  EXPECT_EQ(mapper.states(beyond), std::vector<SpaceState>(beyond.size(), SpaceState::kUnknown));
  for (const Eigen::Vector3f& point : within) EXPECT_EQ(mapper.states({point}).front(), SpaceState::kOccupied);
}

TEST(MapperStates, OfAnEmptyMapAndOfNoPoints) {
  const Mapper mapper(as_recorded());
  EXPECT_TRUE(mapper.states({}).empty());
  EXPECT_EQ(mapper.states({Eigen::Vector3f(1, 2, 3)}), std::vector<SpaceState>{SpaceState::kUnknown});
}

TEST(MapperStates, PointsThatAreNotFiniteAreRefused) {
  Mapper mapper(as_recorded());
  mapper.integrate(plane_frame(coarse_camera(), 2).view());
  const Points points = {Eigen::Vector3f::Zero(), Eigen::Vector3f(0, std::nanf(""), 0)};
  EXPECT_EQ(fault_of<Error>([&] { mapper.states(points); }), "Point 1 is not finite, so that it has no state.");
}

/// What was put down hides what is behind it, although older views have seen it.
TEST(MapperStates, WhatWasTakenBackIsUnknown) {
  Mapper mapper(undecimated());
  const auto integrate = [&](int first, int last, bool box) {
    for (int n = first; n < last; ++n) {
      replay::RecordedFrame frame = plane_frame(working_camera(), 2, Eigen::Isometry3d(Eigen::Translation3d(0.008 * n, 0, 0)));
      if (box) frame.depth(cv::Rect(50, 30, 60, 60)) = 1.5;
      mapper.integrate(frame.view());
    }
  };
  integrate(0, 20, false);
  const Eigen::Vector3f behind(0.2F, 0, 1.6F);
  EXPECT_EQ(mapper.states({behind}).front(), SpaceState::kFree);
  integrate(20, 40, true);
  EXPECT_EQ(mapper.states({behind}).front(), SpaceState::kUnknown);
  integrate(40, 42, false);
  EXPECT_EQ(mapper.states({behind}).front(), SpaceState::kFree);
}

/// A camera that looks along z sees a wall at 2 m.
TEST(MapperStates, RaysEndAtTheFirstThingOnTheirWay) {
  Mapper mapper(as_recorded());
  mapper.integrate(plane_frame(working_camera(), 2).view());
  const auto along_axis = [](float from, float to) { return Ray{{0, 0, from}, {0, 0, to}}; };
  const std::vector<Ray> rays = {along_axis(0.6F, 1.5F), along_axis(0.6F, 5), along_axis(5, 0.6F),
                                 along_axis(-1, 1),      along_axis(1, 1),    Ray{{0, 0, 1}, {9, 0, 1}}};
  const std::vector<RayState> states = mapper.ray_states(rays, true), through = mapper.ray_states(rays, false);
  const auto expect = [](const RayState& state, SpaceState expected, float distance) {
    EXPECT_EQ(state.state, expected);
    EXPECT_NEAR(state.distance, distance, 0.031) << static_cast<int>(expected);  // a voxel is 1.5 cm large
  };
  expect(states[0], SpaceState::kFree, 0.9F);
  expect(states[1], SpaceState::kOccupied, 1.4F);
  expect(states[2], SpaceState::kUnknown, 0);
  expect(states[3], SpaceState::kUnknown, 0);
  expect(states[4], SpaceState::kFree, 0);
  EXPECT_EQ(states[5].state, SpaceState::kUnknown);  // it leaves the view at its side
  EXPECT_NEAR(states[5].distance, 0.5 * 160 / working_camera().fx, 0.02);
  expect(through[0], SpaceState::kFree, 0.9F);
  expect(through[1], SpaceState::kOccupied, 1.4F);
  expect(through[2], SpaceState::kOccupied, 3);
  expect(through[3], SpaceState::kFree, 2);
  expect(through[5], SpaceState::kFree, 9);
}

/// Against the states of points along each ray.
TEST(MapperStates, RaysAreTheirPoints) {
  const Frames frames = orbit_frames(coarse_camera(), 10, 10);
  Mapper mapper(as_recorded());
  integrate_all(mapper, frames);
  const Points ends = random_points(400, 6, box_around(mapper.surfels()));
  std::vector<Ray> rays;
  for (std::size_t n = 0; n < ends.size(); n += 2) rays.push_back({ends[n], ends[n + 1]});
  for (const bool stop_at_unknown : {true, false}) {
    const std::vector<RayState> states = mapper.ray_states(rays, stop_at_unknown, 0.02);
    std::size_t stopped = 0;
    for (std::size_t n = 0; n < rays.size(); ++n) {
      const Eigen::Vector3f way = rays[n].to - rays[n].from;
      const int count = static_cast<int>(std::ceil(way.norm() / 0.02F));
      Points points;
      for (int m = 0; m <= count; ++m) points.push_back(rays[n].from + way * (static_cast<float>(m) / static_cast<float>(count)));
      const std::vector<SpaceState> of_points = mapper.states(points);
      const auto stop = std::find_if(of_points.begin(), of_points.end(), [&](SpaceState state) {
        return state == SpaceState::kOccupied || (stop_at_unknown && state == SpaceState::kUnknown);
      });
      EXPECT_EQ(states[n].state, stop == of_points.end() ? SpaceState::kFree : *stop) << n;
      const auto at = stop == of_points.end() ? count : stop - of_points.begin();
      EXPECT_NEAR(states[n].distance, (points[at] - rays[n].from).norm(), 1e-4) << n;
      stopped += stop != of_points.end();
    }
    EXPECT_GT(stopped, 20U);
  }
}

TEST(MapperStates, RaysThatMakeNoSenseAreRefused) {
  const Mapper mapper(as_recorded());
  EXPECT_TRUE(mapper.ray_states({}, true).empty());
  const Ray endless = {{0, 0, 0}, {0, 0, std::numeric_limits<float>::infinity()}}, long_one = {{0, 0, 0}, {0, 0, 1e5F}};
  EXPECT_EQ(fault_of<Error>([&] { mapper.ray_states({Ray(), endless}, true); }), "Ray 1 has an end that is not finite.");
  EXPECT_EQ(fault_of<Error>([&] { mapper.ray_states({long_one}, true); }), "Ray 0 is 100000 m long, too much for steps of 0.01 m.");
  for (const double step : {0.0, -1.0, 1e-5, std::nan("")}) EXPECT_THROW(mapper.ray_states({Ray()}, true, step), Error);
}

/// Questions change nothing.
TEST(MapperStates, TheMapStaysAsItIs) {
  const Frames frames = orbit_frames(coarse_camera(), 16, 5);
  Config config = as_recorded();
  config.recent_views = 4;
  Mapper asked(config), left_alone(config);
  for (const auto& frame : frames) {
    asked.integrate(frame.view());
    left_alone.integrate(frame.view());
    asked.states(random_points(200, 5, box_around(asked.surfels())));
  }
  EXPECT_TRUE(same(asked.surfels(), left_alone.surfels()));
}

}  // namespace
}  // namespace frontier_surfels
