/// Images and cameras of ROS messages as this library wants them.
#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>
#include <string>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::replay {

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

}  // namespace frontier_surfels::replay
