/// Maps of many kinds of cameras and motions.
#include <gtest/gtest.h>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

using Eigen::Vector3d;

/// Limits of the exact score for voxels of at most 2 cm.
struct Limits {
  double right = 0.95, within_2v = 0.99, fdr_5cm = 0.005, miss_2cm = 0.002, miss_5cm = 0.0005, label_ok = 0.97;
};

void expect_score(const Frames& frames, const Config& config, const Limits& limits = {}) {
  const std::vector<Surfel> surfels = map_of(frames, config);
  const auto s = score(surfels, frames, config);
  SCOPED_TRACE(text(s, surfels.size()));
  EXPECT_TRUE(all_sound(surfels));
  EXPECT_GE(s.right, limits.right);
  EXPECT_GE(s.within_2v, limits.within_2v);
  EXPECT_LE(s.fdr_5cm, limits.fdr_5cm);
  EXPECT_LE(s.miss_2cm, limits.miss_2cm);
  EXPECT_LE(s.miss_5cm, limits.miss_5cm);
  EXPECT_GE(s.label_ok, limits.label_ok);
}

TEST(MapperCameras, FocalLengthsThatDiffer) { expect_score(orbit_frames({180, 90, 59.3, 44.6, 120, 90}, 6, 4), undecimated()); }

TEST(MapperCameras, PrincipalPointFarOffTheCentre) {
  const Intrinsics camera = {140, 118, 28.3, 67.6, 120, 90};
  expect_score(orbit_frames(camera, 6, 4), undecimated());
}

TEST(MapperCameras, FieldOfView15Degrees) {
  Limits limits;
  limits.fdr_5cm = 0.008;  // the tips of the view pyramids, thinner than a voxel, are a large part of such a narrow map
  expect_score(orbit_frames(plain_camera(80, 60, 304), 6, 1), undecimated(), limits);
}

TEST(MapperCameras, FieldOfView100Degrees) { expect_score(orbit_frames(plain_camera(312, 120, 131), 4, 6), undecimated()); }

TEST(MapperCameras, RotationAboutTheCameraCentre) {
  const replay::Room room;
  Frames frames;
  for (int n = 0; n < 6; ++n) {
    const double yaw = n * M_PI / 3;
    frames.push_back(room_frame(room, working_camera(), look_along({0.9, 1.3, 1.4}, {std::cos(yaw), std::sin(yaw), -0.3})));
  }
  expect_score(frames, undecimated());
}

TEST(MapperCameras, RollAndUpsideDown) {
  const replay::Room room;
  Frames frames;
  for (int n = 0; n < 6; ++n) {
    Eigen::Isometry3d pose = replay::orbit_pose(3 * n, 200);
    pose.rotate(Eigen::AngleAxisd(n * M_PI / 6, Vector3d::UnitZ()));
    frames.push_back(room_frame(room, working_camera(), pose));
  }
  expect_score(frames, undecimated());
}

TEST(MapperCameras, AKilometreFromTheOrigin) {
  Frames frames = orbit_frames(working_camera(), 6, 4);
  for (auto& frame : frames) frame.T_world_camera.pretranslate(Vector3d(1000, -700, 50));
  expect_score(frames, undecimated());
}

TEST(MapperCameras, LongRange) {
  Config config = undecimated();
  config.z_max = 8;
  Limits limits;
  limits.miss_2cm = 0.015;  // voxels of 4 cm at the room's far end
  expect_score(orbit_frames(working_camera(), 6, 6), config, limits);
}

TEST(MapperCameras, SizeAndIntrinsicsChangeFromFrameToFrame) {
  const replay::Room room;
  const Intrinsics cameras[] = {
      working_camera(), plain_camera(97, 71, 140), {150, 150, 110, 60, 200, 110}, working_camera(), plain_camera(63, 107, 125)};
  Frames frames;
  for (int n = 0; n < 10; ++n) frames.push_back(room_frame(room, cameras[n % 5], replay::orbit_pose(4 * n, 200)));
  expect_score(frames, undecimated());
}

/// Every lost pixel is a needle of unknown space, one voxel thin, until another frame looks there. Most of the map consists of needles.
TEST(MapperCameras, AQuarterOfThePixelsInvalid) {
  Frames frames = orbit_frames(plain_camera(80, 60, 131), 8, 1);
  cv::RNG random(5);
  for (auto& frame : frames)
    for (int v = 0; v < frame.depth.rows; ++v)
      for (int u = 0; u < frame.depth.cols; ++u)
        if (random.uniform(0, 4) == 0) frame.depth.at<float>(v, u) = 0;
  Limits limits;
  limits.miss_2cm = 0.006;
  expect_score(frames, undecimated(), limits);
}

TEST(MapperCameras, ThePapersMethodAlone) {
  Config config = undecimated();
  config.recent_views = 0;
  expect_score(orbit_frames(working_camera(), 6, 4), config);
}

/// Vertical poles of 3 cm diameter, 1.5 m away, in front of a wall at 2.5 m. The camera passes by.
constexpr double kPoleRadius = 0.015, kPoleDepth = 1.5;
const double kPoles[] = {-0.6, -0.2, 0.1, 0.5};

replay::RecordedFrame poles_frame(const Intrinsics& camera, double x_camera) {
  const Eigen::Isometry3d pose(Eigen::Translation3d(x_camera, 0, 0));
  replay::RecordedFrame frame = plane_frame(camera, 2.5, pose);
  for (int u = 0; u < camera.width; ++u) {
    const double a = (u - camera.cx) / camera.fx;
    for (const double x_pole : kPoles) {  // (a z - x)^2 + (z - z_pole)^2 = r^2
      const double x = x_pole - x_camera, b = a * x + kPoleDepth, c = x * x + kPoleDepth * kPoleDepth - kPoleRadius * kPoleRadius;
      const double root = b * b - (a * a + 1) * c;
      if (root > 0) frame.depth.col(u).setTo((b - std::sqrt(root)) / (a * a + 1));
    }
  }
  return frame;
}

TEST(MapperCameras, ThinPoles) {
  Frames frames;
  for (int n = 0; n < 6; ++n) frames.push_back(poles_frame(working_camera(), -0.3 + 0.1 * n));
  expect_score(frames, undecimated());

  const std::vector<Surfel> surfels = map_of(frames, undecimated());
  for (const double x_pole : kPoles)
    for (double y = -0.4; y <= 0.4; y += 0.1)
      EXPECT_TRUE(std::any_of(surfels.begin(), surfels.end(),
                              [&](const Surfel& s) {
                                const Vector3d front(x_pole, y, kPoleDepth - kPoleRadius);
                                return s.label == Label::kOccupied && (s.position.cast<double>() - front).norm() < 0.025;
                              }))
          << "no surface at the pole " << x_pole << ", height " << y;
}

TEST(MapperCameras, TowardsAWall) {
  const Intrinsics camera = coarse_camera();
  const double focal = (camera.fx + camera.fy) / 2, wall = 2.5;
  Mapper mapper(undecimated());
  Frames frames;
  std::size_t split = 0;
  for (int n = 0; n <= 22; ++n) {
    const double depth = wall - 0.1 * n;
    frames.push_back(plane_frame(camera, depth, Eigen::Isometry3d(Eigen::Translation3d(0, 0, wall - depth))));
    split += mapper.integrate(frames.back().view()).split;
  }
  EXPECT_GT(split, 0U) << "voxels at the wall are five times larger from the first position than from the last";

  const std::vector<Surfel> surfels = mapper.surfels();
  const auto s = score(surfels, frames, undecimated());
  SCOPED_TRACE(text(s, surfels.size()));
  EXPECT_TRUE(all_sound(surfels));
  EXPECT_GE(s.right, 0.98);
  EXPECT_GE(s.within_2v, 0.995);
  EXPECT_LE(s.fdr_5cm, 0.001);
  EXPECT_LE(s.miss_5cm, 0.0005);
  EXPECT_GE(s.label_ok, 0.98);
  for (const Surfel& surfel : surfels) {
    if (surfel.label != Label::kOccupied) continue;
    EXPECT_NEAR(surfel.position.z(), wall, 1.5 * wall / focal);
    EXPECT_LT(surfel.normal.z(), -0.5F) << "normals point towards the camera";
  }
}

}  // namespace
}  // namespace frontier_surfels
