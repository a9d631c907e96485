/// The simulated camera goes where it is told, but not through solids, and its pictures are those of where it is.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "random_world.hpp"
#include "synthetic/simulated_camera.hpp"
#include "synthetic/synthetic_flat.hpp"
#include "synthetic/synthetic_sensor.hpp"

using Eigen::Isometry3d;
using Eigen::Vector3d;
using frontier_surfels::Error;
using namespace frontier_surfels::replay;

namespace {

Isometry3d at(const Vector3d& p, double yaw = 0) { return Eigen::Translation3d(p) * Isometry3d(Eigen::AngleAxisd(yaw, Vector3d::UnitZ())); }

SimulatedCameraOptions small_images() {
  SimulatedCameraOptions options;
  options.intrinsics = camera_of_view(40, 30, kKinectView);
  return options;
}

TEST(SimulatedCamera, LooksAlongTheBodysX) {
  const Isometry3d T = T_body_optical();
  EXPECT_EQ(T * Vector3d::UnitZ(), Vector3d::UnitX()) << "forward";
  EXPECT_EQ(T * Vector3d::UnitX(), Vector3d(-Vector3d::UnitY())) << "right";
  EXPECT_EQ(T * Vector3d::UnitY(), Vector3d(-Vector3d::UnitZ())) << "down";
  const auto camera = camera_of_view(640, 480, 90);
  EXPECT_NEAR(camera.fx, 320, 1e-9);
  EXPECT_EQ(camera.fx, camera.fy);
  EXPECT_EQ(camera.cx, 319.5);
}

TEST(SimulatedCamera, MovesAndTurns) {
  const World flat = synthetic_flat();
  SimulatedCamera camera(flat, flat_start(), small_images());
  EXPECT_EQ(camera.T_world_body().matrix(), flat_start().matrix());
  const Isometry3d goal = at({2.9, 3.95, 1.2}, -M_PI / 2);
  const Move move = camera.move_to(goal);
  EXPECT_TRUE(move.reached);
  EXPECT_NEAR(move.metres, 2.1, 1e-12);
  EXPECT_EQ(move.message, "The camera has reached its goal, 2.10 m away.");
  EXPECT_EQ(camera.T_world_body().matrix(), goal.matrix());
  EXPECT_TRUE(camera.move_to(at({2.9, 2.0, 1.2})).reached) << "through the living room's door";
  EXPECT_NEAR(camera.metres(), 2.1 + 1.95, 1e-9);
}

TEST(SimulatedCamera, StopsBeforeSolids) {
  const World flat = synthetic_flat();
  SimulatedCamera camera(flat, flat_start(), small_images());
  const Isometry3d goal = at({0.8, 6.5, 1.2}, 1);
  const Move move = camera.move_to(goal);
  EXPECT_FALSE(move.reached);
  EXPECT_NEAR(move.metres, 4.57 - 0.2 - 3.95, 2e-3) << "before the picture at the corridor's wall";
  EXPECT_EQ(move.message, "The camera has stopped after 0.42 of 2.55 m: a solid would come closer than 0.2 m.");
  EXPECT_GE(flat.distance(camera.T_world_body().translation()), 0.2);
  EXPECT_EQ(camera.T_world_body().linear(), goal.linear()) << "it turns in any case";
  EXPECT_NEAR(camera.metres(), move.metres, 1e-12);
  EXPECT_NEAR(camera.move_to(goal).metres, 0, 2e-3) << "again";
  EXPECT_TRUE(camera.move_to(flat_start()).reached) << "and back";
}

TEST(SimulatedCamera, TakesPicturesOfWhereItIs) {
  const World flat = synthetic_flat();
  SimulatedCamera camera(flat, flat_start(), small_images());
  for (int k = 0; k < 2; ++k) {
    const SensedFrame& frame = camera.image();
    EXPECT_EQ(frame.measured.index, static_cast<std::size_t>(k));
    EXPECT_NEAR(frame.measured.stamp, 1 + k / 30.0, 1e-12);
    ASSERT_EQ(frame.measured.depth.type(), CV_32FC1);
    EXPECT_EQ(frame.measured.T_world_camera.matrix(), camera.T_world_camera().matrix());
    const View expected = flat.render(camera.T_world_camera(), camera.options().intrinsics);
    EXPECT_EQ(cv::countNonZero(expected.depth != frame.measured.depth), 0);
    camera.move_to(at({3, 3.95, 1.0}, 0.4));
  }
  EXPECT_EQ(camera.images(), 2);
}

TEST(SimulatedCamera, HasTheErrorsOfASensor) {
  const World flat = synthetic_flat();
  SimulatedCameraOptions options = small_images();
  options.sensor.noise = true;
  options.sensor.position_noise = 0.01;
  SimulatedCamera camera(flat, flat_start(), options), same(flat, flat_start(), options);
  options.sensor.seed = 2;
  SimulatedCamera other(flat, flat_start(), options);
  const SensedFrame frame = camera.image();
  ASSERT_EQ(frame.measured.depth.type(), CV_16UC1);
  const View view = flat.render(camera.T_world_camera(), camera.options().intrinsics);
  EXPECT_EQ(cv::countNonZero(measure(view.depth, view.cos_incidence, camera.options().sensor, 0) != frame.measured.depth), 0);
  EXPECT_EQ(frame.ideal.T_world_camera.matrix(), camera.T_world_camera().matrix());
  EXPECT_NE(frame.measured.T_world_camera.matrix(), camera.T_world_camera().matrix());
  EXPECT_EQ(cv::countNonZero(same.image().measured.depth != frame.measured.depth), 0);
  EXPECT_GT(cv::countNonZero(other.image().measured.depth != frame.measured.depth), 100);
  EXPECT_GT(cv::countNonZero(camera.image().measured.depth != frame.measured.depth), 100) << "each picture has its own noise";
}

TEST(SimulatedCamera, StartsAgain) {
  const World flat = synthetic_flat();
  SimulatedCameraOptions options = small_images();
  options.sensor.noise = true;
  SimulatedCamera camera(flat, flat_start(), options);
  const cv::Mat first = camera.image().measured.depth.clone();
  camera.move_to(at({3, 3.95, 1.0}, 0.4));
  camera.image();
  camera.restart();
  EXPECT_EQ(camera.T_world_body().matrix(), flat_start().matrix());
  EXPECT_EQ(camera.metres(), 0);
  EXPECT_EQ(camera.images(), 0);
  EXPECT_EQ(cv::countNonZero(camera.image().measured.depth != first), 0);
}

TEST(SimulatedCamera, RefusesWhatMakesNoSense) {
  const World flat = synthetic_flat();
  SimulatedCamera camera(flat, flat_start(), small_images());
  Isometry3d bad = flat_start();
  bad.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(refused([&] { camera.move_to(bad); }).find("goal"), std::string::npos);
  bad = flat_start();
  bad.linear() *= 2;
  EXPECT_NE(refused([&] { camera.move_to(bad); }).find("goal"), std::string::npos);
  EXPECT_EQ(camera.T_world_body().matrix(), flat_start().matrix());
  EXPECT_EQ(camera.metres(), 0);
  EXPECT_NE(refused([&] { SimulatedCamera(flat, bad); }).find("start"), std::string::npos);
  EXPECT_NE(refused([&] { SimulatedCamera(flat, at({0.1, 3.95, 1.2})); }).find("0.1, 3.95, 1.2 m: a solid is less"), std::string::npos);
  SimulatedCameraOptions options;
  options.radius = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(refused([&] { SimulatedCamera(flat, flat_start(), options); }).find("radius"), std::string::npos);
  options = {};
  options.intrinsics.width = 0;
  EXPECT_NE(refused([&] { SimulatedCamera(flat, flat_start(), options); }).find("intrinsics"), std::string::npos);
}

}  // namespace
