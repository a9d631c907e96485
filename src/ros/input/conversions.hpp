/// Images, cameras and poses of ROS messages as this library wants them.
#pragma once

#include <geometry_msgs/Transform.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>
#include <string>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::messages {

/// An image as it was recorded, raw or compressed: one of the two is set.
struct ImageMessage {
  sensor_msgs::ImageConstPtr raw;
  sensor_msgs::CompressedImageConstPtr compressed;

  explicit operator bool() const { return raw || compressed; }
  const std_msgs::Header& header() const { return raw ? raw->header : compressed->header; }
};

/// Depth as CV_16UC1 [mm] or CV_32FC1 [m] in this machine's byte order; 0 or NaN = no measurement. Raw: 16UC1, mono16, 32FC1.
/// Compressed: PNG of 16 bits, or compressedDepth's PNG of 16UC1 or of the quantised inverse of 32FC1. @throws BadFrame
cv::Mat depth_image(const ImageMessage& message);

/// Colour or grey as CV_8UC3 in BGR order. @throws BadFrame
cv::Mat color_image(const ImageMessage& message);

/// Pinhole camera of the images that come with `info`: the rectified P where there is one, else K; binning and region of interest applied.
/// Width and height are 0 where the message does not say them. @throws BadFrame
Intrinsics to_intrinsics(const sensor_msgs::CameraInfo& info);

/// The same for the depth images that come with it, of `image_size`. @throws BadFrame if it is of another size
Intrinsics to_intrinsics(const sensor_msgs::CameraInfo& info, const cv::Size& image_size);

/// A rigid transform, of whatever quaternion. @throws BadFrame if it is not finite
Eigen::Isometry3d to_isometry(const geometry_msgs::Transform& transform);

/// Colour belongs to a depth image if it was taken so little before or after it [s].
constexpr double kColorTolerance = 0.030;

/// From one time to the other [s]. ros::Duration throws where stamps are senseless.
inline double seconds(const ros::Time& from, const ros::Time& to) {
  return 1e-9 * static_cast<double>(static_cast<std::int64_t>(to.toNSec() - from.toNSec()));
}

/// A name as tf2 wants it: "/world" -> "world".
std::string strip_slash(const std::string& name);

/// compressedDepth's way to put metres into 16 bits: value = a / depth + b, 0 = no measurement.
struct InverseDepthQuantisation {
  float a;
  float b;
};

/// What stands before the PNG in a compressedDepth message.
struct CompressedDepthHeader {
  std::int32_t format;  ///< unused
  InverseDepthQuantisation quantisation;
};
static_assert(sizeof(CompressedDepthHeader) == 12, "the header is read and written as it lies in memory");

}  // namespace frontier_surfels::messages
