/// Makes bags and messages, and compares images, for the tests of bags.
#pragma once

#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "recordings/frame_source.hpp"
#include "ros/input/conversions.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels::replay {

namespace fs = std::filesystem;

inline std::vector<RecordedFrame> read_all(FrameSource& source) {
  std::vector<RecordedFrame> frames;
  while (std::optional<RecordedFrame> frame = source.next()) frames.push_back(std::move(*frame));
  return frames;
}

/// Whether two images are the same, NaN included.
inline bool same_bytes(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && a.isContinuous() && b.isContinuous() &&
         std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

/// A folder for bags that is removed after the test.
class BagTest : public testing::Test {
 protected:
  std::string failure(const SourceOptions& options = {}) const {
    try {
      open_source(path_, options);
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  }

  const TemporaryFolder temporary_{"bag_source"};
  const fs::path folder_ = temporary_.path();
  std::string path_ = (folder_ / "test.bag").string();
};

/// Size of every image made here [pixel].
inline constexpr int kWidth = 4, kHeight = 3;

inline sensor_msgs::Image depth_message(double stamp, std::uint16_t value = 1500) {
  sensor_msgs::Image image;
  image.header.stamp = ros::Time(stamp);
  image.header.frame_id = "camera";
  image.width = kWidth;
  image.height = kHeight;
  image.encoding = "16UC1";
  image.step = 2 * kWidth;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    image.data.push_back(static_cast<std::uint8_t>(value & 255));
    image.data.push_back(static_cast<std::uint8_t>(value >> 8));
  }
  return image;
}

/// Depth of 32FC1 with this quantisation.
inline sensor_msgs::CompressedImage compressed_depth(double stamp, float a, float b) {
  const messages::CompressedDepthHeader header = {0, {a, b}};
  std::vector<std::uint8_t> png;
  cv::imencode(".png", cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(100)), png);
  sensor_msgs::CompressedImage message;
  message.header = depth_message(stamp).header;
  message.format = "32FC1; compressedDepth";
  message.data.resize(sizeof(header));
  std::memcpy(message.data.data(), &header, sizeof(header));
  message.data.insert(message.data.end(), png.begin(), png.end());
  return message;
}

inline sensor_msgs::Image color_message(double stamp, const std::string& encoding, const std::vector<std::uint8_t>& pixel) {
  sensor_msgs::Image image = depth_message(stamp);
  image.encoding = encoding;
  image.step = static_cast<std::uint32_t>(kWidth * pixel.size());
  image.data.clear();
  for (int i = 0; i < kWidth * kHeight; ++i) image.data.insert(image.data.end(), pixel.begin(), pixel.end());
  return image;
}

inline sensor_msgs::CameraInfo info_message(double stamp, double focal_length = 5) {
  sensor_msgs::CameraInfo info;
  info.header.stamp = ros::Time(stamp);
  info.width = kWidth;
  info.height = kHeight;
  info.K = {focal_length, 0, 1.5, 0, focal_length + 1, 1.25, 0, 0, 1};
  return info;
}

inline tf2_msgs::TFMessage tf_message(double stamp, const std::string& parent, const std::string& child, double x) {
  tf2_msgs::TFMessage message;
  message.transforms.resize(1);
  message.transforms[0].header.stamp = ros::Time(stamp);
  message.transforms[0].header.frame_id = parent;
  message.transforms[0].child_frame_id = child;
  message.transforms[0].transform.translation.x = x;
  message.transforms[0].transform.rotation.w = 1;
  return message;
}

/// Writes messages, at any time.
class Handmade {
 public:
  explicit Handmade(const std::string& path, rosbag::CompressionType compression = rosbag::compression::Uncompressed) {
    bag_.open(path, rosbag::bagmode::Write);
    bag_.setCompression(compression);
  }

  template <typename Message>
  Handmade& add(const std::string& topic, double time, const Message& message) {
    return add_at(topic, ros::Time(time), message);
  }

  template <typename Message>
  Handmade& add_at(const std::string& topic, const ros::Time& time, const Message& message) {
    bag_.write(topic, time, message);
    return *this;
  }

  void close() { bag_.close(); }

  /// A message of the first version of tf, which is the same except for the name of its type.
  Handmade& add_of_old_type(const std::string& topic, double time, const tf2_msgs::TFMessage& message) {
    namespace traits = ros::message_traits;
    const ros::M_string header = {
        {"type", "tf/tfMessage"}, {"md5sum", traits::md5sum(message)}, {"message_definition", traits::definition(message)}};
    bag_.write(topic, ros::Time(time), message, boost::make_shared<ros::M_string>(header));
    return *this;
  }

  /// Transforms of a camera that moves 1 m in 1 s from time 10 on, which all tests need.
  Handmade& add_camera_and_motion() {
    add("/depth/camera_info", 10, info_message(10));
    add("/tf", 10, tf_message(10, "world", "camera", 0));
    return add("/tf", 11, tf_message(11, "world", "camera", 1));
  }

 private:
  rosbag::Bag bag_;
};

}  // namespace frontier_surfels::replay
