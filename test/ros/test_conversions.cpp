/// Single messages: every encoding of images, and cameras.
#include <gtest/gtest.h>
#include <sensor_msgs/CompressedImage.h>

#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "ros/bag_input.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels::replay {

using namespace messages;

namespace {

ImageMessage raw(const sensor_msgs::Image& image) { return {boost::make_shared<sensor_msgs::Image>(image), nullptr}; }

ImageMessage compressed(const std::string& format, const cv::Mat& image, const std::vector<float>& header = {},
                        const char* extension = ".png") {
  const auto message = boost::make_shared<sensor_msgs::CompressedImage>();
  message->format = format;
  cv::imencode(extension, image, message->data);
  std::vector<std::uint8_t> bytes(4 * header.size());
  if (!header.empty()) std::memcpy(bytes.data(), header.data(), bytes.size());
  message->data.insert(message->data.begin(), bytes.begin(), bytes.end());
  return {nullptr, message};
}

cv::Mat depth_image(const ImageMessage& message) { return copy(depth_pixels(message).view); }

cv::Mat color_image(const ImageMessage& message) { return copy(color_pixels(message).view); }

TEST(DepthMessages, RespectStepAndByteOrder) {
  sensor_msgs::Image image = depth_message(10);
  image.step = 11;
  image.is_bigendian = 1;
  image.data.assign(image.step * kHeight, 0xff);
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      image.data[static_cast<std::size_t>(11 * row + 2 * column)] = 4;
      image.data[static_cast<std::size_t>(11 * row + 2 * column + 1)] = static_cast<std::uint8_t>(10 * row + column);
    }
  }
  for (const char* encoding : {"16UC1", "mono16"}) {
    image.encoding = encoding;
    const cv::Mat depth = depth_image(raw(image));
    ASSERT_EQ(depth.type(), CV_16UC1);
    EXPECT_EQ(depth.at<std::uint16_t>(0, 0), 1024);
    EXPECT_EQ(depth.at<std::uint16_t>(2, 3), 1024 + 23);
  }

  image.encoding = "32FC1";
  image.step = 4 * kWidth;
  image.data.clear();
  for (int i = 0; i < kWidth * kHeight; ++i) image.data.insert(image.data.end(), {0x3f, 0xc0, 0, 0});  // 1.5, big-endian
  const cv::Mat depth = depth_image(raw(image));
  ASSERT_EQ(depth.type(), CV_32FC1);
  EXPECT_EQ(depth.at<float>(2, 3), 1.5f);
}

TEST(DepthMessages, AreViewedWhereTheyLie) {
  for (const bool big_endian : {false, true}) {
    sensor_msgs::Image image = depth_message(10);
    image.is_bigendian = big_endian;
    ImageMessage message = raw(image);
    const std::uint8_t* data = message.raw->data.data();
    const Pixels<DepthImage> pixels = depth_pixels(message);
    EXPECT_EQ(pixels.view.data, data);
    EXPECT_EQ(pixels.view.width, kWidth);
    EXPECT_EQ(pixels.view.height, kHeight);
    EXPECT_EQ(pixels.view.step, image.step);
    EXPECT_EQ(pixels.view.encoding, DepthImage::Encoding::kStepsU16);
    EXPECT_EQ(pixels.view.swap_bytes, big_endian) << "this test is for little-endian machines";
    EXPECT_EQ(message.raw.use_count(), 2) << "the pixels keep the message alive";
  }
}

TEST(DepthMessages, StateTheirSizeWithoutBeingDecoded) {
  EXPECT_EQ(stated_size(raw(depth_message(10))), cv::Size(kWidth, kHeight));
  EXPECT_FALSE(stated_size(compressed("png", cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(2020)))));
}

TEST(DepthMessages, RefuseWhatIsMalformed) {
  sensor_msgs::Image image = depth_message(10);
  image.step = 7;  // shorter than a row
  image.data.resize(7 * kHeight);
  EXPECT_THROW(depth_image(raw(image)), BadFrame);
  image = depth_message(10);
  image.width = 0;
  EXPECT_THROW(depth_image(raw(image)), BadFrame);
  image = depth_message(10);
  image.width = image.height = image.step = 1u << 16;  // their product is 0 in 32 bits
  image.data.clear();
  EXPECT_THROW(depth_image(raw(image)), BadFrame);
  image = depth_message(10);
  image.encoding = "rgb8";
  EXPECT_THROW(depth_image(raw(image)), BadFrame);
}

TEST(DepthMessages, CompressedOnes) {
  cv::Mat values(kHeight, kWidth, CV_16UC1, cv::Scalar(2020));
  values.at<std::uint16_t>(0, 0) = 0;
  EXPECT_TRUE(same_bytes(depth_image(compressed("png", values)), values));
  EXPECT_TRUE(same_bytes(depth_image(compressed("16UC1; compressedDepth", values, {0, 0, 0})), values));
  EXPECT_TRUE(same_bytes(depth_image(compressed("16UC1; compressedDepth png", values, {0, 0, 0})), values));

  const cv::Mat metres = depth_image(compressed("32FC1; compressedDepth", values, {0, 10100, -1010}));
  ASSERT_EQ(metres.type(), CV_32FC1);
  EXPECT_TRUE(std::isnan(metres.at<float>(0, 0)));
  EXPECT_FLOAT_EQ(metres.at<float>(1, 1), 10100.0f / (2020 + 1010));

  EXPECT_THROW(depth_image(compressed("jpeg", cv::Mat(3, 4, CV_8UC3), {}, ".jpg")), BadFrame);
  EXPECT_THROW(depth_image(compressed("16UC1; compressedDepth rvl", values, {0, 0, 0})), BadFrame);
  EXPECT_THROW(depth_image(compressed("16UC1; compressedDepth", values)), BadFrame) << "no header: the image is cut";
  sensor_msgs::CompressedImage empty;
  EXPECT_THROW(depth_image({nullptr, boost::make_shared<sensor_msgs::CompressedImage>(empty)}), BadFrame);
}

TEST(ColourMessages, AllOrdersBecomeBgr) {
  const cv::Vec3b bgr(30, 20, 10);
  EXPECT_EQ(color_image(raw(color_message(1, "rgb8", {10, 20, 30}))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_EQ(color_image(raw(color_message(1, "bgr8", {30, 20, 10}))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_EQ(color_image(raw(color_message(1, "rgba8", {10, 20, 30, 99}))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_EQ(color_image(raw(color_message(1, "bgra8", {30, 20, 10, 99}))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_EQ(color_image(raw(color_message(1, "mono8", {77}))).at<cv::Vec3b>(2, 3), cv::Vec3b(77, 77, 77));
  EXPECT_EQ(color_image(compressed("bgr8; png compressed bgr8", cv::Mat(3, 4, CV_8UC3, cv::Scalar(30, 20, 10)))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_THROW(color_image(raw(color_message(1, "nonsense", {1}))), BadFrame);
}

TEST(ColourMessages, OfFourOrdersAreViewedWhereTheyLie) {
  using Order = ColorImage::Order;
  const struct {
    const char* encoding;
    Order order;
    int channels;
  } kCases[] = {{"rgb8", Order::kRgb, 3}, {"bgr8", Order::kBgr, 3}, {"rgba8", Order::kRgb, 4}, {"bgra8", Order::kBgr, 4}};
  for (const auto& expected : kCases) {
    const ImageMessage message =
        raw(color_message(1, expected.encoding, std::vector<std::uint8_t>(static_cast<std::size_t>(expected.channels), 7)));
    const Pixels<ColorImage> pixels = color_pixels(message);
    EXPECT_EQ(pixels.view.data, message.raw->data.data()) << expected.encoding;
    EXPECT_EQ(pixels.view.order, expected.order);
    EXPECT_EQ(pixels.view.channels, expected.channels);
    EXPECT_EQ(pixels.view.step, message.raw->step);
  }
}

TEST(DepthMessages, ImpossibleQuantisationIsRefused) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto pixels_of = [](float a, float b) {
    return depth_pixels({nullptr, boost::make_shared<sensor_msgs::CompressedImage>(compressed_depth(1, a, b))});
  };
  EXPECT_EQ(pixels_of(100, 0).view.width, kWidth);
  for (const auto& [a, b] : {std::pair(0.0F, 0.0F),
                             {nan, 1.0F},
                             {1.0F, nan},
                             {std::numeric_limits<float>::infinity(), 0.0F},
                             {-100.0F, 0.0F},
                             {100.0F, 65535.0F}})
    EXPECT_THROW(pixels_of(a, b), BadFrame) << a << " " << b;
}

TEST(ColourMessages, AreRefusedWhenTheyAreCutShort) {
  for (const char* encoding : {"rgb8", "bgra8", "mono8"}) {
    sensor_msgs::Image image = color_message(1, encoding, {1, 2, 3, 4});
    image.data.pop_back();
    EXPECT_THROW(color_pixels(raw(image)), BadFrame);
  }
  sensor_msgs::Image narrow = color_message(1, "rgb8", {1, 2});  // its rows are shorter than its pixels
  EXPECT_THROW(color_pixels(raw(narrow)), BadFrame);
}

TEST(CameraMessages, RectifiedBinnedAndCropped) {
  sensor_msgs::CameraInfo info = info_message(1);
  EXPECT_EQ(to_intrinsics(info).fy, 6) << "K is used where there is no P";
  info.width = 640;
  info.height = 480;
  info.P = {500, 0, 320, 0, 0, 490, 240, 0, 0, 0, 1, 0};
  EXPECT_EQ(to_intrinsics(info).fx, 500);
  EXPECT_EQ(to_intrinsics(info).width, 640);

  info.roi.x_offset = 100;
  info.roi.y_offset = 40;
  info.roi.width = 400;
  info.roi.height = 200;
  info.binning_x = 4;
  info.binning_y = 2;
  const Intrinsics intrinsics = to_intrinsics(info);
  EXPECT_EQ(intrinsics.fx, 125);
  EXPECT_EQ(intrinsics.fy, 245);
  EXPECT_EQ(intrinsics.cx, 55);
  EXPECT_EQ(intrinsics.cy, 100);
  EXPECT_EQ(intrinsics.width, 100);
  EXPECT_EQ(intrinsics.height, 100);

  info.roi.x_offset = 240;
  EXPECT_EQ(to_intrinsics(info).width, 100) << "at the edge of the sensor";
  for (const auto& [x, y, width, height] : {std::array{241U, 40U, 400U, 200U},
                                            {0, 0, 641, 480},
                                            {0, 281, 400, 200},
                                            {0, 0, 400, 0},
                                            {700, 0, 10, 10},
                                            {4294967295U, 0, 2, 2}}) {
    sensor_msgs::CameraInfo outside = info;
    outside.roi.x_offset = x;
    outside.roi.y_offset = y;
    outside.roi.width = width;
    outside.roi.height = height;
    EXPECT_THROW(to_intrinsics(outside), BadFrame) << x << " " << y << " " << width << " " << height;
  }

  info.P[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(to_intrinsics(info), BadFrame);
  EXPECT_THROW(to_intrinsics(sensor_msgs::CameraInfo()), BadFrame);
}

}  // namespace
}  // namespace frontier_surfels::replay
