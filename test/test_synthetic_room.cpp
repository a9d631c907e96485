/// The synthetic room: its images agree with its exact geometry, and the errors of its sensor are as stated.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "synthetic/synthetic_room.hpp"

using Eigen::Vector3d;
using frontier_surfels::Intrinsics;
using namespace frontier_surfels::replay;

namespace {

constexpr int kFrames = 60;

double lost_share(const cv::Mat& depth) { return 1 - static_cast<double>(cv::countNonZero(depth)) / static_cast<double>(depth.total()); }

TEST(Room, CastMeetsKnownSurfaces) {
  const Room room;
  const auto hit_down = room.cast({1.2, 1.2, 1.5}, {0, 0, -1});
  ASSERT_TRUE(hit_down);
  EXPECT_NEAR(hit_down->distance, 1.5, 1e-12) << "the floor";
  EXPECT_NEAR((hit_down->normal - Vector3d::UnitZ()).norm(), 0, 1e-12);
  EXPECT_NEAR(room.cast({-0.5, 0.2, 1.5}, {0, 0, -2})->distance, 0.76 / 2, 1e-12) << "the table, in lengths of the direction";
  EXPECT_NEAR(room.cast({0.45, 0.05, 1.5}, {0, 0, -1})->distance, 0.64 - 0.12, 1e-12) << "the ball's top";
  EXPECT_NEAR(room.cast({-0.25, -1.0, 0.9}, {0, 1, 0})->distance, 0.8 - 0.06, 1e-12) << "the vase's side";
  EXPECT_NEAR(room.cast({-0.25, -0.2, 1.5}, {0, 0, -1})->distance, 0.5, 1e-12) << "the vase's lid";
  EXPECT_NEAR(room.cast({1.0, 1.5, 1.0}, {0, 1, 0})->distance, 2.4, 1e-12) << "through the door to the corridor's end";
  EXPECT_NEAR(room.cast({1.0, 1.5, 2.2}, {0, 1, 0})->distance, 1.0, 1e-12) << "above the door";
}

TEST(Room, DistanceIsExactInFreeSpaceAndNegativeInSolids) {
  const Room room;
  EXPECT_NEAR(room.distance({1.2, 1.2, 0.4}), 0.4, 1e-12);
  EXPECT_NEAR(room.distance({0.45, 0.05, 1.2}), 0.34 - 0.12, 1e-12);
  EXPECT_NEAR(room.distance({-0.25, -0.2 - 0.06 - 0.03, 1.0 + 0.04}), 0.05, 1e-12) << "the vase's rim";
  EXPECT_NEAR(room.distance({-0.58, 0.34, 0.74 + 0.12}), 0.13, 1e-12) << "the table's corner";
  EXPECT_TRUE(room.inside_solid({0.45, 0.05, 0.86}));
  EXPECT_TRUE(room.inside_solid({-2.05, 0, 1}));
  EXPECT_FALSE(room.inside_solid({0, 0, 1.5}));
}

/// Marching along a ray by the distance to the nearest surface must end where cast() says.
TEST(Room, CastAgreesWithDistance) {
  const Room room;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int i = 0; i < 3000; ++i) {
    const Vector3d origin(1.9 * number(random), 2.4 * number(random), 1.25 + 1.2 * number(random));
    const Vector3d direction = Vector3d(number(random), number(random), number(random)).normalized();
    if (room.distance(origin) < 0.01) continue;
    const auto hit = room.cast(origin, direction);
    ASSERT_TRUE(hit) << "a hole in the room, seen from " << origin.transpose();
    const Vector3d p_world = origin + hit->distance * direction;
    EXPECT_NEAR(room.distance(p_world), 0, 1e-9);
    EXPECT_LT(hit->normal.dot(direction), 1e-9);
    EXPECT_GT(room.distance(p_world + 1e-6 * hit->normal), 0);
    double t = 0;
    for (int step = 0; step < 2000 && t < hit->distance - 1e-4; ++step) t += std::max(1e-5, room.distance(origin + t * direction));
    EXPECT_NEAR(t, hit->distance, 1e-3) << "from " << origin.transpose() << " along " << direction.transpose();
  }
}

TEST(Room, OrbitKeepsClearOfEverything) {
  const Room room;
  double turned = 0;
  for (int index = 0; index < kFrames; ++index) {
    const Eigen::Isometry3d T_world_camera = orbit_pose(index, kFrames);
    EXPECT_GT(room.distance(T_world_camera.translation()), 0.25) << "frame " << index;
    EXPECT_NEAR((T_world_camera.linear().transpose() * T_world_camera.linear() - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
    EXPECT_GT(T_world_camera.linear().determinant(), 0);
    EXPECT_LT((T_world_camera.linear() * Vector3d::UnitY()).z(), -0.5) << "down in the image is down in the room";
    const Eigen::Isometry3d step = T_world_camera.inverse() * orbit_pose(index + 1, kFrames);
    EXPECT_LT(step.translation().norm(), 0.25) << "frame " << index;
    turned = std::max(turned, Eigen::AngleAxisd(step.rotation()).angle());
  }
  EXPECT_LT(turned, 0.3);
}

/// Share of the room's surface, as seen from the middle, that some frame of a path sees.
double seen_share(const Room& room, CameraPath path) {
  const Intrinsics camera = synthetic_camera(160, 120);
  const Vector3d middle(0.1, -1.0, 1.2);
  std::mt19937 random(3);
  std::normal_distribution<double> number;
  int seen = 0;
  constexpr int kPoints = 500;
  for (int n = 0; n < kPoints; ++n) {
    const Vector3d direction(number(random), number(random), number(random));
    const Vector3d p_world = middle + 0.999 * room.cast(middle, direction)->distance * direction;
    for (int index = 0; index < kFrames; ++index) {
      const Eigen::Isometry3d T_world_camera = camera_pose(path, index, kFrames);
      const Vector3d p = T_world_camera.inverse() * p_world;
      const double u = camera.fx * p.x() / p.z() + camera.cx, v = camera.fy * p.y() / p.z() + camera.cy;
      if (p.z() <= 0 || u < 0 || v < 0 || u > camera.width - 1 || v > camera.height - 1) continue;
      if (room.depth(T_world_camera, camera, u, v) < p.z()) continue;
      ++seen;
      break;
    }
  }
  return static_cast<double>(seen) / kPoints;
}

TEST(Room, ExploringSeesNearlyEverything) {
  const Room room;
  EXPECT_GT(seen_share(room, CameraPath::kExplore), 0.95);
  EXPECT_LT(seen_share(room, CameraPath::kOrbit), 0.8) << "the other paths leave the ceiling out";
  for (int index = 0; index < kFrames; ++index)
    EXPECT_GT(room.distance(camera_pose(CameraPath::kExplore, index, kFrames).translation()), 0.25) << "frame " << index;
}

TEST(Room, RendersItsOwnDepth) {
  const Room room;
  const Intrinsics camera = synthetic_camera(65, 47);
  EXPECT_NE(camera.fx, camera.fy);
  const RecordedFrame frame = room.render(13, kFrames, camera);
  EXPECT_EQ(frame.depth.type(), CV_32FC1);
  EXPECT_EQ(frame.depth.size(), cv::Size(65, 47));
  EXPECT_EQ(frame.color.size(), frame.depth.size());
  EXPECT_NEAR(frame.stamp, 1 + 13 / 30.0, 1e-12);
  EXPECT_EQ(frame.T_world_camera.matrix(), orbit_pose(13, kFrames).matrix());
  for (int row = 0; row < camera.height; row += 3) {
    for (int column = 0; column < camera.width; column += 2) {
      const float depth = frame.depth.at<float>(row, column);
      EXPECT_EQ(depth, static_cast<float>(room.depth(frame.T_world_camera, camera, column, row)));
      const Vector3d p_camera((column - camera.cx) / camera.fx * depth, (row - camera.cy) / camera.fy * depth, depth);
      EXPECT_NEAR(room.distance(frame.T_world_camera * p_camera), 0, 1e-5);
    }
  }
}

TEST(Room, ExactSensorOnlyRoundsToMillimetres) {
  const Room room;
  const Intrinsics camera = synthetic_camera(80, 60);
  const cv::Mat exact = room.render(5, kFrames, camera).depth;
  const cv::Mat measured = room.render(5, kFrames, camera, SensorModel()).depth;
  ASSERT_EQ(measured.type(), CV_16UC1);
  cv::Mat millimetres;
  measured.convertTo(millimetres, CV_32FC1);
  EXPECT_LE(cv::norm(millimetres, exact * 1000, cv::NORM_INF), 0.501);
}

TEST(Room, NoiseGrowsWithTheSquareOfDepth) {
  const Room room;
  const Intrinsics camera = synthetic_camera(320, 240);
  SensorModel sensor;
  sensor.noise = true;
  double sum = 0, sum_of_squares = 0;
  std::size_t count = 0;
  for (const int index : {3, 23, 43}) {
    const cv::Mat exact = room.render(index, kFrames, camera).depth;
    const cv::Mat measured = room.render(index, kFrames, camera, sensor).depth;
    for (int i = 0; i < static_cast<int>(exact.total()); ++i) {
      const double z = exact.at<float>(i / 320, i % 320);
      const double error = (measured.at<std::uint16_t>(i / 320, i % 320) * 1e-3 - z) / (z * z);
      sum += error;
      sum_of_squares += error * error;
      ++count;
    }
  }
  // Half a step of deviation and the rounding to steps: sqrt(1/4 + 1/12) of 2.85e-3; millimetres add a little.
  EXPECT_NEAR(std::sqrt(sum_of_squares / static_cast<double>(count)), 2.85e-3 * std::sqrt(1.0 / 4 + 1.0 / 12), 0.1e-3);
  EXPECT_NEAR(sum / static_cast<double>(count), 0, 0.05e-3);
}

TEST(Room, DropoutsTakeTheirShareAndTheEdges) {
  const Room room;
  const Intrinsics camera = synthetic_camera(320, 240);
  SensorModel sensor;
  EXPECT_EQ(lost_share(room.render(3, kFrames, camera, sensor).depth), 0);
  sensor.dropouts = 1e-9;
  const double edges = lost_share(room.render(3, kFrames, camera, sensor).depth);
  EXPECT_GT(edges, 0.003);
  EXPECT_LT(edges, 0.08);
  sensor.dropouts = 0.1;
  const double all = lost_share(room.render(3, kFrames, camera, sensor).depth);
  EXPECT_NEAR(all, 0.1 + edges * 0.9, 0.01);
}

TEST(Room, IsTheSameForTheSameSeed) {
  const Room room;
  const Intrinsics camera = synthetic_camera(160, 120);
  SensorModel sensor;
  sensor.noise = true;
  sensor.dropouts = 0.05;
  const cv::Mat first = room.render(7, kFrames, camera, sensor).depth;
  EXPECT_EQ(cv::norm(first, room.render(7, kFrames, camera, sensor).depth), 0);
  sensor.seed = 2;
  EXPECT_GT(cv::norm(first, room.render(7, kFrames, camera, sensor).depth), 0);
}

}  // namespace
