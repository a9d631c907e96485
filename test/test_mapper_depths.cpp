/// Depths that are missing, out of range, infinite, or few.
#include <gtest/gtest.h>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

using Eigen::Vector3d;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// The map of one image with the same depth everywhere.
std::vector<Surfel> map_of_plane(double depth, const Config& config = undecimated()) {
  return map_of({plane_frame(coarse_camera(), depth)}, config);
}

std::size_t occupied(const std::vector<Surfel>& surfels) {
  return std::count_if(surfels.begin(), surfels.end(), [](const Surfel& s) { return s.label == Label::kOccupied; });
}

double voxel_at(double z) { return z / ((coarse_camera().fx + coarse_camera().fy) / 2); }

/// Number of pixels whose ray has no surfel at the depth of a plane in front of the camera, which stands at the origin.
int pixels_without_surfel(const std::vector<Surfel>& surfels, double depth, Label label) {
  const Intrinsics camera = coarse_camera();
  cv::Mat met = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  for (const Surfel& s : surfels) {
    const Vector3d p = s.position.cast<double>();
    if (s.label != label || std::abs(p.z() - depth) > 1.5 * voxel_at(depth)) continue;
    const long u = std::lround(p.x() / p.z() * camera.fx + camera.cx), v = std::lround(p.y() / p.z() * camera.fy + camera.cy);
    if (u >= 0 && v >= 0 && u < camera.width && v < camera.height) met.at<std::uint8_t>(v, u) = 1;
  }
  return static_cast<int>(met.total()) - cv::countNonZero(met);
}

TEST(MapperDepths, NothingMeasuredMakesNoSurfel) {
  for (const float depth : {0.0F, kNan, -kNan, -1.0F, -kInfinity, kInfinity, 0.499F, 3.001F, 1e30F, 1e-40F}) {
    Mapper mapper(undecimated());
    const Report report = mapper.integrate(plane_frame(coarse_camera(), depth).view());
    EXPECT_EQ(report.surfels, 0u) << depth;
    EXPECT_EQ(report.created, 0u) << depth;
    EXPECT_EQ(report.measured_pixels, 0u) << depth;
    EXPECT_TRUE(mapper.surfels().empty()) << depth;
    EXPECT_EQ(mapper.sequence(), 1u) << "the frame counts";
  }
}

TEST(MapperDepths, ReportsHowManyPixelsHaveMeasuredSomething) {
  Config config = undecimated();
  config.carve_no_return = true;
  replay::RecordedFrame frame = plane_frame(coarse_camera(), 1);
  frame.depth.colRange(0, 10).setTo(0);
  frame.depth.colRange(10, 30).setTo(kInfinity);
  Mapper mapper(config);
  EXPECT_EQ(mapper.integrate(frame.view()).measured_pixels, 60u * 70u);
}

TEST(MapperDepths, NothingMeasuredChangesNothing) {
  Mapper mapper(undecimated());
  integrate_all(mapper, orbit_frames(coarse_camera(), 3, 5));
  const auto before = mapper.surfels();
  ASSERT_GT(before.size(), 10000u);
  for (const float depth : {0.0F, kNan, 0.3F, 5.0F, kInfinity}) {
    const Report report = mapper.integrate(plane_frame(coarse_camera(), depth, replay::orbit_pose(5, 200)).view());
    EXPECT_EQ(report.created + report.removed, 0u) << depth;
    EXPECT_TRUE(same(before, mapper.surfels())) << depth;
  }
}

/// Pixels that are NaN, negative, infinite or out of range are handled like 0.
TEST(MapperDepths, AllKindsOfMissingPixelsAreAlike) {
  const Frames frames = orbit_frames(coarse_camera(), 3, 5);
  std::vector<std::vector<Surfel>> maps;
  for (const float missing : {0.0F, kNan, -2.0F, 0.2F, kInfinity, 7.0F}) {
    Frames spoiled;
    for (const auto& frame : frames) {
      spoiled.push_back(frame);
      spoiled.back().depth = frame.depth.clone();
      for (int v = 0; v < frame.depth.rows; ++v)
        for (int u = v % 5; u < frame.depth.cols; u += 5) spoiled.back().depth.at<float>(v, u) = missing;
    }
    maps.push_back(map_of(spoiled, undecimated()));
    EXPECT_TRUE(same(maps.front(), maps.back())) << missing;
  }
  EXPECT_GT(maps.front().size(), 10000u);
  EXPECT_FALSE(same(maps.front(), map_of(frames, undecimated()))) << "the missing pixels would have made a difference";
}

TEST(MapperDepths, PlanesAtTheEndsOfTheRange) {
  for (const double depth : {0.5, 0.51, 1.0, 2.0, 2.999, 3.0}) {
    const auto surfels = map_of_plane(depth);
    EXPECT_TRUE(all_sound(surfels));
    EXPECT_EQ(pixels_without_surfel(surfels, depth, Label::kOccupied), 0) << "holes in the plane at " << depth;
    for (const Surfel& s : surfels) {
      EXPECT_LT(s.position.z(), depth + 1.5 * voxel_at(depth)) << depth;
      if (s.label == Label::kFrontier) continue;
      // At most about a voxel before or behind the plane.
      EXPECT_NEAR(s.position.z(), depth, 1.5 * voxel_at(depth)) << depth;
      EXPECT_LT(s.normal.z(), 0) << "the normal points away from the camera";
      EXPECT_NEAR(s.radius, 0.8660254 * voxel_at(s.position.z()), 0.05 * voxel_at(depth)) << depth;
    }
    if (HasFailure()) return;
  }
}

TEST(MapperDepths, CarvedUpToTheMaximumRange) {
  Config no_return = undecimated(), beyond = undecimated();
  no_return.carve_no_return = true;
  beyond.carve_beyond_range = true;
  const auto free_space = map_of_plane(kInfinity, no_return);
  EXPECT_TRUE(all_sound(free_space));
  EXPECT_EQ(occupied(free_space), 0u);
  EXPECT_EQ(pixels_without_surfel(free_space, 3.0, Label::kFrontier), 0) << "the far end is closed";
  for (const Surfel& s : free_space) ASSERT_LT(s.position.z(), 3.0 + 1.5 * voxel_at(3));

  EXPECT_TRUE(same(free_space, map_of_plane(3.5, beyond)));
  EXPECT_TRUE(same(free_space, map_of_plane(1e30, beyond)));
  EXPECT_TRUE(map_of_plane(3.5, no_return).empty()) << "carve_no_return is for +Inf alone";
  EXPECT_TRUE(map_of_plane(kInfinity, beyond).empty()) << "carve_beyond_range is not for +Inf";
  EXPECT_TRUE(map_of_plane(kNan, no_return).empty());
  EXPECT_TRUE(map_of_plane(kNan, beyond).empty());
}

TEST(MapperDepths, CarvedSpaceBesideAWall) {
  Config config = undecimated();
  config.carve_no_return = true;
  replay::RecordedFrame frame = plane_frame(coarse_camera(), 1.5);
  frame.depth.colRange(40, 80).setTo(kInfinity);
  const auto surfels = map_of({frame}, config);
  std::size_t wall = 0;
  for (const Surfel& s : surfels) {
    if (s.label == Label::kFrontier) continue;
    ++wall;
    EXPECT_NEAR(s.position.z(), 1.5, 1.5 * voxel_at(1.5));
    EXPECT_LT(s.position.x() / s.position.z() * frame.intrinsics.fx + frame.intrinsics.cx, 40.5);
  }
  EXPECT_GE(wall, 40u * 60u);
  EXPECT_TRUE(std::any_of(surfels.begin(), surfels.end(), [](const Surfel& s) { return s.position.z() > 2.9F; }));
}

/// The exact test knows what the mapper carves: most of this room is beyond the range, and some of its pixels met nothing.
TEST(MapperDepths, ACarvedRoomMeasuresUpToTheExactTest) {
  Config config = undecimated();
  config.z_max = 1.8;
  config.carve_no_return = true;
  config.carve_beyond_range = true;
  Frames frames = orbit_frames(working_camera(), 6, 4);
  std::size_t no_return = 0, beyond = 0, all = 0;
  for (auto& frame : frames)
    for (float& depth : cv::Mat_<float>(frame.depth)) {  // shares the image's pixels
      if (depth > 2.4F) depth = kInfinity;
      no_return += std::isinf(depth);
      beyond += depth > config.z_max && !std::isinf(depth);
      ++all;
    }
  ASSERT_GT(no_return, all / 20);
  ASSERT_GT(beyond, all / 20);
  const auto surfels = map_of(frames, config);
  const auto s = score(surfels, frames, config);
  SCOPED_TRACE(text(s, surfels.size()));
  EXPECT_GE(s.right, 0.99);
  EXPECT_LE(s.miss_2cm, 0.002);
}

TEST(MapperDepths, ASinglePixel) {
  const Intrinsics camera = coarse_camera();
  replay::RecordedFrame frame = plane_frame(camera, 0);
  const int u = 17, v = 44;
  const double depth = 2;
  frame.depth.at<float>(v, u) = depth;
  const auto surfels = map_of({frame}, undecimated());
  EXPECT_TRUE(all_sound(surfels));
  EXPECT_EQ(occupied(surfels), 1u);
  // A column of about f ln(z / z_min) + f voxels, four sides each.
  const double layers = camera.fx * (std::log(depth / 0.5) + 1);
  EXPECT_GT(surfels.size(), 3.5 * layers);
  EXPECT_LT(surfels.size(), 7 * layers);
  for (const Surfel& s : surfels) {
    const Vector3d p = s.position.cast<double>(), ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
    const double voxel = voxel_at(std::max(0.5, p.z()));
    EXPECT_LT((p - p.z() * ray).cwiseAbs().maxCoeff(), 1.6 * voxel) << p.transpose();
    EXPECT_LT(p.z(), depth + 1.6 * voxel);
    EXPECT_GT(p.z(), -1.6 * voxel);
    if (s.label == Label::kOccupied) {
      EXPECT_LT((p - depth * ray).norm(), 1.5 * voxel);
    }
  }
}

/// If the decimation does not divide the image's size, the last columns and rows are not used.
TEST(MapperDepths, DecimationThatDoesNotDivideTheSize) {
  const replay::Room room;
  Config config;
  config.decimation = 5;
  const Intrinsics full = replay::synthetic_camera(324, 243);
  Frames odd, cropped;
  for (const int index : {0, 10}) {
    odd.push_back(room_frame(room, full, replay::orbit_pose(index, 200)));
    cropped.push_back(odd.back());
    cropped.back().depth = odd.back().depth(cv::Rect(0, 0, 320, 240)).clone();
    cropped.back().intrinsics.width = 320;
    cropped.back().intrinsics.height = 240;
  }
  const auto surfels = map_of(odd, config);
  EXPECT_GT(surfels.size(), 20000u);
  EXPECT_TRUE(same(surfels, map_of(cropped, config)));
}

}  // namespace
}  // namespace frontier_surfels
