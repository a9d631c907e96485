/// The synthetic flat is closed, all its rooms can be reached, and it is one that a planner has to look through.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "random_world.hpp"
#include "synthetic/camera_lattice.hpp"
#include "synthetic/simulated_camera.hpp"
#include "synthetic/synthetic_flat.hpp"

using Eigen::Vector3d;
using namespace frontier_surfels::replay;

namespace {

constexpr double kRadius = 0.2;

TEST(Flat, IsClosed) {
  const World flat = synthetic_flat();
  EXPECT_GT(flat.solids().size(), 100U);
  EXPECT_EQ(flat_bounds().sizes(), Vector3d(10, 8, 2.5));
  Random random(1);
  for (int i = 0; i < 20000; ++i) {
    const Vector3d origin = point_in(random, flat_bounds());
    const Vector3d direction = point_in(random, {Vector3d::Constant(-1), Vector3d::Constant(1)});
    if (flat.distance(origin) < 1e-6) continue;
    const auto hit = flat.cast(origin, direction);
    ASSERT_TRUE(hit) << "a hole, seen from " << origin.transpose();
    const Vector3d p = origin + hit->distance * direction;
    ASSERT_TRUE(flat_bounds().exteriorDistance(p) < 1e-9) << "a hole at " << p.transpose();
    ASSERT_NEAR(flat.distance(p), 0, 1e-9);
  }
}

/// The middle of every door, with half of its width and its height to all sides.
TEST(Flat, DoorsAreWideEnough) {
  const World flat = synthetic_flat();
  const std::vector<Vector3d> doors = {{2.9, 3.25, 1.2},  {8.475, 3.25, 1.2}, {1.95, 4.65, 1.2},
                                       {4.95, 4.65, 1.2}, {8.95, 4.65, 1.2},  {5.95, 1.7, 1.2}};
  for (const Vector3d& door : doors) {
    EXPECT_GE(flat.distance(door), 0.45 - 1e-9) << door.transpose();
    EXPECT_GE(flat.distance({door.x(), door.y(), 0.6}), 0.45 - 1e-9) << "no threshold at " << door.transpose();
    const Vector3d across = door.x() == 5.95 ? Vector3d(0.8, 0, 0) : Vector3d(0, 0.8, 0);
    EXPECT_EQ(flat.free_length(door - across, door + across, kRadius), (door + across - (door - across)).norm()) << door.transpose();
  }
}

TEST(Flat, AllRoomsCanBeReached) {
  const World flat = synthetic_flat();
  Eigen::AlignedBox3d box = flat_bounds();
  box.min().z() = 0.4;
  box.max().z() = 2.1;
  const CameraLattice lattice(flat, box, flat_start().translation(), 0.25, kRadius);
  for (const Vector3d& room : {Vector3d(3.0, 2.6, 1.2), Vector3d(8.6, 1.5, 1.2), Vector3d(2.8, 5.6, 1.2), Vector3d(5.0, 6.2, 1.2),
                               Vector3d(7.6, 6.4, 1.2), Vector3d(7.0, 4.0, 1.2)}) {
    EXPECT_GT(flat.distance(room), kRadius);
    EXPECT_TRUE(lattice.any_near(room, 0.3, [&](const Vector3d& p) { return flat.sees(p, room); })) << room.transpose();
  }
  EXPECT_EQ(flat_starts().size(), 5U);
  for (const Eigen::Isometry3d& start : flat_starts()) {
    EXPECT_GT(flat.distance(start.translation()), kRadius);
    EXPECT_TRUE(lattice.any_near(start.translation(), 0.3, [&](const Vector3d& p) { return flat.sees(p, start.translation()); }));
  }
  for (const Vector3d& p : lattice.positions()) {
    ASSERT_GE(flat.distance(p), kRadius);
    ASSERT_TRUE(box.contains(p));
  }
}

/// From no place can more than a part of the flat be seen.
TEST(Flat, HasToBeLookedThrough) {
  const World flat = synthetic_flat();
  const std::vector<Vector3d> rooms = {{3.0, 2.6, 1.2}, {8.6, 2.6, 1.2}, {2.8, 5.6, 1.2}, {5.0, 6.2, 1.2}, {7.6, 6.4, 1.2}};
  for (const Vector3d& from : rooms) {
    for (const Vector3d& to : rooms) EXPECT_EQ(flat.sees(from, to), from == to) << from.transpose() << " " << to.transpose();
  }
}

TEST(Flat, ImagesAgreeWithRaysOnAnyNumberOfThreads) {
  const World flat = synthetic_flat();
  const Eigen::Isometry3d T_world_camera = flat_start() * Eigen::AngleAxisd(0.3, Vector3d(0.1, 0.2, 0.9).normalized()) * T_body_optical();
  const auto camera = camera_of_view(67, 43, kKinectView);
  const View view = flat.render(T_world_camera, camera), same = flat.render(T_world_camera, camera, 3);
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      ASSERT_EQ(view.depth.at<float>(v, u), static_cast<float>(flat.depth(T_world_camera, camera, u, v)));
      ASSERT_EQ(view.depth.at<float>(v, u), same.depth.at<float>(v, u));
      ASSERT_EQ(view.color.at<cv::Vec3b>(v, u), same.color.at<cv::Vec3b>(v, u));
      ASSERT_EQ(view.cos_incidence.at<float>(v, u), same.cos_incidence.at<float>(v, u));
      ASSERT_LE(view.cos_incidence.at<float>(v, u), 1 + 1e-6F);
    }
  }
}

}  // namespace
