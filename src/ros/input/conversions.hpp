/// Images, cameras and poses of ROS messages as the types of this library.
#pragma once

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Transform.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::messages {

/// A message with an image, raw or compressed: exactly one of the two is set, or none if there is no image.
struct ImageMessage {
  sensor_msgs::ImageConstPtr raw;
  sensor_msgs::CompressedImageConstPtr compressed;

  explicit operator bool() const { return raw || compressed; }
  const std_msgs::Header& header() const { return raw ? raw->header : compressed->header; }
};

/// A view of pixels where they lie, and what keeps them alive: the message itself, or the image that was decoded from it.
template <typename View>
struct Pixels {
  View view;
  boost::shared_ptr<const void> owner;
};

/// The pixels of a depth image. 0 or NaN means that there is no measurement.
/// A raw message (16UC1, mono16 or 32FC1, in either byte order) is not copied. A compressed one is decoded: a PNG of 16 bits, or
/// compressedDepth's PNG of 16UC1 or of the quantised inverse of 32FC1.
/// @throws BadFrame if the encoding is another one, or the data do not fit the size
Pixels<DepthImage> depth_pixels(const ImageMessage& message);

/// The pixels of a colour image. A raw message of rgb8, bgr8, rgba8 or bgra8 is not copied. All other encodings (grey, Bayer, 16 bits) are
/// converted by cv_bridge, and compressed images are decoded.
/// @throws BadFrame if the encoding is unknown, or the data do not fit the size
Pixels<ColorImage> color_pixels(const ImageMessage& message);

/// Width and height as a raw message states them; empty for a compressed one, whose size is known only after decoding.
std::optional<cv::Size> stated_size(const ImageMessage& message);

/// A copy that owns its pixels: CV_16UC1 [mm] or CV_32FC1 [m], in this machine's byte order and without gaps between rows.
cv::Mat copy(const DepthImage& image);

/// A copy that owns its pixels: CV_8UC3 in BGR order, without gaps between rows.
cv::Mat copy(const ColorImage& image);

/// The pinhole camera that `info` describes: its rectified P where there is one, else K, with binning and region of interest applied.
/// Width and height are 0 where the message does not state them. @throws BadFrame if a number is not finite, a focal length not
/// positive, or the region of interest not within the sensor
Intrinsics to_intrinsics(const sensor_msgs::CameraInfo& info);

/// The same for a depth image of `image_size` pixels. @throws BadFrame also if the message states another size
Intrinsics to_intrinsics(const sensor_msgs::CameraInfo& info, const cv::Size& image_size);

/// The message of a pinhole camera without distortion, without its header.
sensor_msgs::CameraInfo to_camera_info(const Intrinsics& intrinsics);

/// A rigid transform; the quaternion is normalised. @throws BadFrame if it is not finite, or the quaternion is 0
Eigen::Isometry3d to_isometry(const geometry_msgs::Transform& transform);
Eigen::Isometry3d to_isometry(const geometry_msgs::Pose& pose);

/// Positions and poses, as they are.
template <typename Vector>
geometry_msgs::Point to_point(const Eigen::MatrixBase<Vector>& p) {
  geometry_msgs::Point point;
  point.x = p.x();
  point.y = p.y();
  point.z = p.z();
  return point;
}
Eigen::Vector3f to_vector(const geometry_msgs::Point& point);
geometry_msgs::Pose to_pose(const Eigen::Isometry3d& T);

/// Largest difference of stamps between a depth image and the colour image that belongs to it [s].
constexpr double kColorTolerance = 0.030;

/// Latest time that is believed [s]; in the year 2038. Some drivers write the largest time, 2^32 s, for "no time".
constexpr std::int32_t kLatestTime = std::numeric_limits<std::int32_t>::max();

/// Whether a stamp can be a time: if not, what has it is used neither live nor from a bag.
inline bool is_believed(const ros::Time& stamp) { return stamp <= ros::Time(kLatestTime, 0); }

/// What is wrong with a stamp that is not believed: "its stamp of 4294967295 s is later than in 2038".
std::string late_stamp(const ros::Time& stamp);

/// The time from `from` to `to` [s]. Unlike ros::Duration it never throws, however far apart the stamps are.
inline double seconds(const ros::Time& from, const ros::Time& to) {
  return 1e-9 * static_cast<double>(static_cast<std::int64_t>(to.toNSec() - from.toNSec()));
}

/// The name without leading slashes, which tf2 does not accept: "/world" becomes "world".
std::string strip_slash(const std::string& name);

/// How compressedDepth stores metres in 16 bits: value = a / depth + b; 0 = no measurement.
struct InverseDepthQuantisation {
  float a;
  float b;
};

/// The bytes before the PNG in a compressedDepth message.
struct CompressedDepthHeader {
  std::int32_t format;  ///< unused
  InverseDepthQuantisation quantisation;
};
static_assert(sizeof(CompressedDepthHeader) == 12, "the header is read and written as it lies in memory");

}  // namespace frontier_surfels::messages
