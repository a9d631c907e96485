/// Maps of many kinds of cameras and motions.
#include <gtest/gtest.h>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

using Eigen::Vector3d;

void expect_score(const Frames& frames, const Config& config, const Errors& reached) {
  Mapper mapper(config);
  const Frames as_mapped = mapped(mapper, frames);
  const std::vector<Surfel> surfels = mapper.surfels();
  const auto s = score(surfels, as_mapped, config);
  SCOPED_TRACE(text(s, surfels.size()));
  EXPECT_TRUE(all_sound(surfels));
  expect_errors(s, reached);
}

TEST(MapperCameras, FocalLengthsThatDiffer) {
  expect_score(orbit_frames({180, 90, 59.3, 44.6, 120, 90}, 6, 4), undecimated(), {0.00508, 0.00245, 0.00137, 0.00037, 0.00000, 0.00427});
}

TEST(MapperCameras, PrincipalPointFarOffTheCentre) {
  const Intrinsics camera = {140, 118, 28.3, 67.6, 120, 90};
  expect_score(orbit_frames(camera, 6, 4), undecimated(), {0.00051, 0.00070, 0.00009, 0.00063, 0.00000, 0.00629});
}

TEST(MapperCameras, FieldOfView15Degrees) {
  expect_score(orbit_frames(plain_camera(80, 60, 304), 6, 1), undecimated(), {0.00177, 0.00245, 0.00217, 0.00019, 0.00000, 0.00040});
}

TEST(MapperCameras, FieldOfView100Degrees) {
  expect_score(orbit_frames(plain_camera(312, 120, 131), 4, 6), undecimated(), {0.00023, 0.00019, 0.00004, 0.00073, 0.00000, 0.01056});
}

TEST(MapperCameras, RotationAboutTheCameraCentre) {
  const replay::Room room;
  Frames frames;
  for (int n = 0; n < 6; ++n) {
    const double yaw = n * M_PI / 3;
    frames.push_back(room_frame(room, working_camera(), look_along({0.9, 1.3, 1.4}, {std::cos(yaw), std::sin(yaw), -0.3})));
  }
  expect_score(frames, undecimated(), {0.00008, 0.00010, 0.00004, 0.00018, 0.00000, 0.00446});
}

TEST(MapperCameras, RollAndUpsideDown) {
  const replay::Room room;
  Frames frames;
  for (int n = 0; n < 6; ++n) {
    Eigen::Isometry3d pose = replay::orbit_pose(3 * n, 200);
    pose.rotate(Eigen::AngleAxisd(n * M_PI / 6, Vector3d::UnitZ()));
    frames.push_back(room_frame(room, working_camera(), pose));
  }
  expect_score(frames, undecimated(), {0.00059, 0.00087, 0.00022, 0.00076, 0.00003, 0.00386});
}

TEST(MapperCameras, AKilometreFromTheOrigin) {
  Frames frames = orbit_frames(working_camera(), 6, 4);
  for (auto& frame : frames) frame.T_world_camera.pretranslate(Vector3d(1000, -700, 50));
  expect_score(frames, undecimated(), {0.00061, 0.00067, 0.00017, 0.00054, 0.00000, 0.00534});
}

TEST(MapperCameras, LongRange) {
  Config config = undecimated();
  config.z_max = 8;
  expect_score(orbit_frames(working_camera(), 6, 6), config, {0.00012, 0.00000, 0.00000, 0.01139, 0.00000, 0.01569});
}

TEST(MapperCameras, SizeAndIntrinsicsChangeFromFrameToFrame) {
  const replay::Room room;
  const Intrinsics cameras[] = {
      working_camera(), plain_camera(97, 71, 140), {150, 150, 110, 60, 200, 110}, working_camera(), plain_camera(63, 107, 125)};
  Frames frames;
  for (int n = 0; n < 10; ++n) frames.push_back(room_frame(room, cameras[n % 5], replay::orbit_pose(4 * n, 200)));
  expect_score(frames, undecimated(), {0.00083, 0.00122, 0.00048, 0.00038, 0.00000, 0.00552});
}

/// Every lost pixel is a needle of unknown space, one voxel thin, until another frame looks there. Most of the map consists of needles.
TEST(MapperCameras, AQuarterOfThePixelsInvalid) {
  Frames frames = orbit_frames(plain_camera(80, 60, 131), 8, 1);
  cv::RNG random(5);
  for (auto& frame : frames)
    for (int v = 0; v < frame.depth.rows; ++v)
      for (int u = 0; u < frame.depth.cols; ++u)
        if (random.uniform(0, 4) == 0) frame.depth.at<float>(v, u) = 0;
  expect_score(frames, undecimated(), {0.00584, 0.00649, 0.00182, 0.00291, 0.00017, 0.01269});
}

TEST(MapperCameras, ThePapersMethodAlone) {
  Config config = undecimated();
  config.recent_views = 0;
  expect_score(orbit_frames(working_camera(), 6, 4), config, {0.01928, 0.00419, 0.00198, 0.00079, 0.00024, 0.00591});
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
  expect_score(frames, undecimated(), {0.00002, 0.00000, 0.00000, 0.00010, 0.00000, 0.00300});

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
  expect_errors(s, {0.00000, 0.00000, 0.00000, 0.05915, 0.00000, 0.00003});
  for (const Surfel& surfel : surfels) {
    if (surfel.label != Label::kOccupied) continue;
    EXPECT_NEAR(surfel.position.z(), wall, 1.5 * wall / focal);
    EXPECT_LT(surfel.normal.z(), -0.5F) << "normals point towards the camera";
  }
}

}  // namespace
}  // namespace frontier_surfels
