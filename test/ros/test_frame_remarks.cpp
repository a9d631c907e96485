/// What is said about frames from which nothing or a wrong map may come.
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "ros/bag_input.hpp"
#include "ros/input/frame_remarks.hpp"

namespace frontier_surfels {
namespace {

using replay::info_message;
using std::chrono::seconds;

class Remarks : public testing::Test {
 protected:
  /// The remarks about a frame whose pixels are all the same.
  template <typename Pixel>
  std::string on(Pixel pixel, int width = 8, double x = 0) {
    return about(remarks_, pixel, width, x);
  }

  template <typename Pixel>
  std::string about(FrameRemarks& remarks, Pixel pixel, int width = 8, double x = 0) const {
    const std::vector<Pixel> pixels(static_cast<std::size_t>(width) * 8, pixel);
    DepthFrame frame;
    frame.depth.data = pixels.data();
    frame.depth.encoding = sizeof(Pixel) == 2 ? DepthImage::Encoding::kStepsU16 : DepthImage::Encoding::kMetresF32;
    frame.depth.width = width;
    frame.depth.height = 8;
    frame.depth.step = sizeof(Pixel) * static_cast<std::size_t>(width);
    frame.T_world_camera = Eigen::Translation3d(x, 0, 0) * Eigen::Isometry3d::Identity();
    return remarks.on(frame, measured_pixels_, info_, now_);
  }

  std::string on_millimetres(int value) { return on(static_cast<std::uint16_t>(value)); }

  static bool says(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

  std::size_t measured_pixels_ = 1;  ///< of the working image
  std::vector<std::string> warned_;
  Config config_;
  FrameRemarks remarks_{config_, [this](const std::string& remark) { warned_.push_back(remark); }};
  sensor_msgs::CameraInfo info_ = info_message(1);
  Throttle::Clock::time_point now_;
};

TEST_F(Remarks, NoneAboutUsualFrames) {
  EXPECT_EQ(on_millimetres(1500), "");
  EXPECT_EQ(on(1.5F), "");
  EXPECT_TRUE(warned_.empty());
}

TEST_F(Remarks, ImagesWithoutAUsablePixelHaveTheLikelyCause) {
  EXPECT_TRUE(says(on_millimetres(0), "no measurement in any pixel"));
  EXPECT_TRUE(says(on(std::numeric_limits<float>::quiet_NaN()), "no measurement in any pixel"));
  EXPECT_TRUE(says(on_millimetres(65535), "65535"));
  EXPECT_TRUE(says(on_millimetres(2), "depth_unit"));
  EXPECT_TRUE(says(on_millimetres(20000), "20 m: 16-bit images are read in steps of depth_unit = 0.001 m"));
  EXPECT_TRUE(says(on(1500.0F), "look like millimetres"));
  EXPECT_TRUE(says(on(7.0F), "z_max"));
}

TEST_F(Remarks, PixelsThatDisagreeHaveTheLikelyCause) {
  measured_pixels_ = 0;
  EXPECT_TRUE(says(on(1.5F), "differ by more than agreement = 0.03"));
  EXPECT_TRUE(says(on_millimetres(1500), "or set sampling: nearest"));
  EXPECT_TRUE(says(on_millimetres(0), "no measurement in any pixel")) << "that is the cause then";
  EXPECT_EQ(warned_.size(), 2U);
}

TEST_F(Remarks, MillimetresAreNotTakenForFreeSpace) {
  config_.carve_beyond_range = true;
  FrameRemarks carving(config_, [](const std::string&) {});
  EXPECT_TRUE(says(about(carving, 1500.0F), "look like millimetres"));
  EXPECT_EQ(about(carving, 7.0F), "");
}

TEST_F(Remarks, FarDepthsThatCarveAreToldOnceIfNothingElseComes) {
  config_.carve_beyond_range = true;
  FrameRemarks carving(config_, [this](const std::string& remark) { warned_.push_back(remark); });
  double x = 0;
  const auto on_next = [&](int millimetres) { return about(carving, static_cast<std::uint16_t>(millimetres), 8, x += 0.01); };
  for (int n = 1; n < FrameRemarks::kFarFrames; ++n) ASSERT_EQ(on_next(20000), "") << n;
  EXPECT_TRUE(says(on_next(20000), "None of the measured depths are from z_min"));
  ASSERT_EQ(warned_.size(), 1U);
  EXPECT_TRUE(says(warned_.back(), "correct depth_unit"));
  for (int n = 0; n < 2 * FrameRemarks::kFarFrames; ++n) ASSERT_EQ(on_next(20000), "");
  EXPECT_EQ(warned_.size(), 1U);
}

TEST_F(Remarks, ACameraMayLookAtAFarWallForAWhile) {
  config_.carve_beyond_range = true;
  FrameRemarks carving(config_, [](const std::string&) {});
  double x = 0;
  for (int n = 0; n < 4 * FrameRemarks::kFarFrames; ++n)
    ASSERT_EQ(about(carving, static_cast<std::uint16_t>(n % 10 == 0 ? 1500 : 20000), 8, x += 0.01), "");
}

/// The pixels are all the same, so every n-th frame stands for every n-th pixel.
TEST_F(Remarks, AWrongUnitIsFoundAlsoIfFewDepthsAreInRange) {
  for (std::size_t n = 1; n < FrameRemarks::kDepthFrames; ++n) on(1500.0F);
  warned_.clear();
  const std::string remark = on(1.5F);
  EXPECT_TRUE(says(remark, "Only 3.33 % of the measured depths are from z_min")) << remark;
  EXPECT_TRUE(says(remark, "look like millimetres")) << remark;
  EXPECT_EQ(warned_, std::vector<std::string>{remark});
  EXPECT_EQ(on(1.5F), "") << "a share of more than 5 %";
}

TEST_F(Remarks, AFewFramesWithoutManyUsableDepthsAreUsual) {
  for (std::size_t n = 2; n < FrameRemarks::kDepthFrames; ++n) on(0.1F);
  EXPECT_EQ(on(1.5F), "");
  remarks_.forget();
  for (std::size_t n = 1; n < FrameRemarks::kDepthFrames; ++n) on(std::numeric_limits<float>::infinity());
  EXPECT_EQ(on(1.5F), "") << "the camera looks into the open";
  for (std::size_t n = 1; n < FrameRemarks::kDepthFrames; ++n) EXPECT_EQ(on(1.5F), "");
  EXPECT_EQ(on(1.5F), "");
}

TEST_F(Remarks, EveryUnusableImageHasAReasonAndFewAreWarnedOf) {
  for (int n = 0; n < 5; ++n) EXPECT_NE(on_millimetres(0), "");
  EXPECT_EQ(warned_.size(), 1U);
  now_ += seconds(11);
  EXPECT_NE(on_millimetres(0), "");
  EXPECT_EQ(warned_.size(), 2U);
}

TEST_F(Remarks, AWarningAboutPixelsHidesNoOther) {
  on_millimetres(0);
  on_millimetres(20000);
  remarks_.warn_of_pixels("A colour image is not used: it is empty.", now_);
  remarks_.warn_of_pixels("A colour image is not used: it is empty.", now_);
  on_millimetres(21000);
  ASSERT_EQ(warned_.size(), 3U);
  EXPECT_TRUE(says(warned_[0], "no measurement"));
  EXPECT_TRUE(says(warned_[1], "depth_unit"));
  EXPECT_TRUE(says(warned_[2], "colour"));
}

TEST_F(Remarks, DistortionWithoutPIsToldOnce) {
  info_.D = {0.1, 0, 0, 0, 0};
  info_.P = {5, 0, 2, 0, 0, 6, 1, 0, 0, 0, 1, 0};
  EXPECT_EQ(on_millimetres(1500), "");
  info_.P.fill(0);
  EXPECT_TRUE(says(on_millimetres(1500), "taken as rectified"));
  EXPECT_EQ(on_millimetres(1500), "");
  EXPECT_EQ(warned_.size(), 1U);
}

TEST_F(Remarks, NoDistortionNeedsNoP) {
  info_.D.assign(5, 0.0);
  info_.P.fill(0);
  EXPECT_EQ(on_millimetres(1500), "");
}

TEST_F(Remarks, AlternatingSizesAreToldOnce) {
  std::string all;
  for (int n = 0; n < 10; ++n) all += on<std::uint16_t>(1500, n % 2 == 0 ? 8 : 12);
  EXPECT_TRUE(says(all, "8x8 and of 12x8 pixels alternate"));
  EXPECT_EQ(warned_.size(), 1U);
}

TEST_F(Remarks, ACameraMayChangeItsSize) {
  for (const int width : {8, 8, 12, 12, 8, 8, 16, 16, 12, 12}) EXPECT_EQ(on<std::uint16_t>(1500, width), "");
}

TEST_F(Remarks, ACameraThatNeverMovesIsToldOnce) {
  for (int n = 1; n < FrameRemarks::kStillFrames; ++n) ASSERT_EQ(on_millimetres(1500), "") << n;
  EXPECT_TRUE(says(on_millimetres(1500), "tf lacks the transform that moves"));
  for (int n = 0; n < 2 * FrameRemarks::kStillFrames; ++n) ASSERT_EQ(on_millimetres(1500), "");
  EXPECT_EQ(warned_.size(), 1U);
}

TEST_F(Remarks, ACameraThatHasMovedMayRest) {
  EXPECT_EQ(on<std::uint16_t>(1500, 8, 0.01), "");
  for (int n = 0; n < 2 * FrameRemarks::kStillFrames; ++n) ASSERT_EQ(on_millimetres(1500), "");
}

}  // namespace
}  // namespace frontier_surfels
