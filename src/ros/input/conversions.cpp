#include "ros/input/conversions.hpp"

#include <boost/predef/other/endian.h>
#include <cv_bridge/cv_bridge.h>
#include <image_geometry/pinhole_camera_model.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "frontier_surfels/number_text.hpp"

namespace frontier_surfels::messages {
namespace {

namespace encodings = sensor_msgs::image_encodings;
constexpr bool kThisMachineIsBigEndian = BOOST_ENDIAN_BIG_BYTE;
constexpr float kSixteenBits = 65535;  // largest value of a compressedDepth's pixels

/// Checks that an image has as many bytes as its size asks for. Computes in 64 bits, because damaged sizes overflow 32.
void check_size(const sensor_msgs::Image& image, std::size_t bytes_per_pixel) {
  const std::uint64_t bytes = static_cast<std::uint64_t>(image.step) * image.height;
  if (image.width == 0 || image.height == 0) throw BadFrame("the image is empty");
  if (image.data.size() != bytes) {
    throw BadFrame("the image has " + std::to_string(image.data.size()) + " bytes instead of " + std::to_string(bytes));
  }
  if (image.step < static_cast<std::uint64_t>(image.width) * bytes_per_pixel) throw BadFrame("the image's step is shorter than its rows");
}

template <typename View>
Pixels<View> view(const sensor_msgs::ImageConstPtr& image) {
  Pixels<View> pixels;
  pixels.view.width = static_cast<int>(image->width);
  pixels.view.height = static_cast<int>(image->height);
  pixels.view.step = image->step;
  pixels.view.data = image->data.data();
  pixels.owner = image;
  return pixels;
}

template <typename View>
Pixels<View> view(const cv::Mat& decoded) {
  Pixels<View> pixels;
  pixels.view.width = decoded.cols;
  pixels.view.height = decoded.rows;
  pixels.view.step = decoded.step[0];
  pixels.view.data = decoded.data;
  pixels.owner = boost::make_shared<cv::Mat>(decoded);
  return pixels;
}

Pixels<DepthImage> view_depth(const cv::Mat& decoded) {
  Pixels<DepthImage> pixels = view<DepthImage>(decoded);
  pixels.view.encoding = decoded.type() == CV_16UC1 ? DepthImage::Encoding::kStepsU16 : DepthImage::Encoding::kMetresF32;
  return pixels;
}

Pixels<DepthImage> view_depth(const sensor_msgs::ImageConstPtr& image, DepthImage::Encoding encoding) {
  check_size(*image, encoding == DepthImage::Encoding::kStepsU16 ? 2 : 4);
  Pixels<DepthImage> pixels = view<DepthImage>(image);
  pixels.view.encoding = encoding;
  pixels.view.swap_bytes = static_cast<bool>(image->is_bigendian) != kThisMachineIsBigEndian;
  return pixels;
}

/// @param decoded  CV_8UC3 in BGR order
Pixels<ColorImage> view_color(const cv::Mat& decoded) {
  Pixels<ColorImage> pixels = view<ColorImage>(decoded);
  pixels.view.order = ColorImage::Order::kBgr;
  return pixels;
}

Pixels<ColorImage> view_color(const sensor_msgs::ImageConstPtr& image, ColorImage::Order order, int channels) {
  check_size(*image, static_cast<std::size_t>(channels));
  Pixels<ColorImage> pixels = view<ColorImage>(image);
  pixels.view.order = order;
  pixels.view.channels = channels;
  return pixels;
}

cv::Mat convert_color(const sensor_msgs::Image& image) {
  check_size(image, 1);
  try {
    return cv_bridge::toCvCopy(image, encodings::BGR8)->image;
  } catch (const std::exception&) {
    throw BadFrame("the image cannot be unpacked (encoding '" + image.encoding + "', step " + std::to_string(image.step) + ")");
  }
}

cv::Mat decode(const std::uint8_t* data, std::size_t size, int flags) {
  const cv::Mat bytes(1, static_cast<int>(size), CV_8UC1, const_cast<std::uint8_t*>(data));
  cv::Mat image;
  try {
    if (size > 0) image = cv::imdecode(bytes, flags);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) throw BadFrame("the compressed image cannot be decoded");
  return image;
}

cv::Mat metres_from_inverse(const cv::Mat& values, const InverseDepthQuantisation& quantisation) {
  cv::Mat metres(values.size(), CV_32FC1);
  std::transform(values.begin<std::uint16_t>(), values.end<std::uint16_t>(), metres.begin<float>(), [&](std::uint16_t value) {
    return value == 0 ? std::numeric_limits<float>::quiet_NaN() : quantisation.a / (static_cast<float>(value) - quantisation.b);
  });
  return metres;
}

cv::Mat decode_depth(const sensor_msgs::CompressedImage& message) {
  const bool has_header = message.format.find("compressedDepth") != std::string::npos;
  const std::size_t offset = has_header ? sizeof(CompressedDepthHeader) : 0;
  if (message.data.size() <= offset) throw BadFrame("the compressed image is empty");
  if (message.format.find("rvl") != std::string::npos) throw BadFrame("RVL compression is not supported: record compressedDepth as PNG");

  const cv::Mat values = decode(message.data.data() + offset, message.data.size() - offset, cv::IMREAD_UNCHANGED);
  if (values.type() != CV_16UC1) throw BadFrame("the compressed image is not one of 16-bit depth");
  if (!has_header || message.format.compare(0, encodings::TYPE_32FC1.size(), encodings::TYPE_32FC1) != 0) return values;

  CompressedDepthHeader header;
  std::memcpy(&header, message.data.data(), sizeof(header));
  const auto [a, b] = header.quantisation;
  if (!std::isfinite(a) || !std::isfinite(b) || a <= 0 || b >= kSixteenBits)  // no value would be a positive depth
    throw BadFrame("its depth quantisation (" + rounded_text(a, 6) + ", " + rounded_text(b, 6) +
                   ") is not valid: record it again with compressed_depth_image_transport, or record raw images");
  return metres_from_inverse(values, header.quantisation);
}

}  // namespace

Pixels<DepthImage> depth_pixels(const ImageMessage& message) {
  if (message.compressed) return view_depth(decode_depth(*message.compressed));
  const std::string& encoding = message.raw->encoding;
  if (encoding == encodings::TYPE_16UC1 || encoding == encodings::MONO16) return view_depth(message.raw, DepthImage::Encoding::kStepsU16);
  if (encoding == encodings::TYPE_32FC1) return view_depth(message.raw, DepthImage::Encoding::kMetresF32);
  throw BadFrame("the encoding '" + encoding + "' is not one of depth (16UC1, mono16, 32FC1)");
}

Pixels<ColorImage> color_pixels(const ImageMessage& message) {
  if (message.compressed) return view_color(decode(message.compressed->data.data(), message.compressed->data.size(), cv::IMREAD_COLOR));
  const std::string& encoding = message.raw->encoding;
  if (encoding == encodings::RGB8) return view_color(message.raw, ColorImage::Order::kRgb, 3);
  if (encoding == encodings::BGR8) return view_color(message.raw, ColorImage::Order::kBgr, 3);
  if (encoding == encodings::RGBA8) return view_color(message.raw, ColorImage::Order::kRgb, 4);
  if (encoding == encodings::BGRA8) return view_color(message.raw, ColorImage::Order::kBgr, 4);
  return view_color(convert_color(*message.raw));
}

std::optional<cv::Size> stated_size(const ImageMessage& message) {
  if (!message.raw) return std::nullopt;
  return cv::Size(static_cast<int>(message.raw->width), static_cast<int>(message.raw->height));
}

cv::Mat copy(const DepthImage& image) {
  cv::Mat depth(image.height, image.width, image.encoding == DepthImage::Encoding::kStepsU16 ? CV_16UC1 : CV_32FC1);
  const std::size_t size = depth.elemSize();
  for (int row = 0; row < depth.rows; ++row) {
    std::uint8_t* values = depth.ptr(row);
    std::memcpy(values, static_cast<const std::uint8_t*>(image.data) + static_cast<std::size_t>(row) * image.step, size * image.width);
    if (!image.swap_bytes) continue;
    for (int column = 0; column < depth.cols; ++column) std::reverse(values + size * column, values + size * (column + 1));
  }
  return depth;
}

cv::Mat copy(const ColorImage& image) {
  const cv::Mat viewed(image.height, image.width, CV_8UC(image.channels), const_cast<std::uint8_t*>(image.data), image.step);
  if (image.order == ColorImage::Order::kBgr && image.channels == 3) return viewed.clone();
  cv::Mat bgr;
  if (image.order == ColorImage::Order::kBgr)
    cv::cvtColor(viewed, bgr, cv::COLOR_BGRA2BGR);
  else
    cv::cvtColor(viewed, bgr, image.channels == 3 ? cv::COLOR_RGB2BGR : cv::COLOR_RGBA2BGR);
  return bgr;
}

namespace {

/// All values 0 mean the whole sensor, whose size may be unknown. @throws BadFrame
void check_region(const sensor_msgs::CameraInfo& info) {
  const sensor_msgs::RegionOfInterest& roi = info.roi;
  const bool is_whole = roi.x_offset == 0 && roi.y_offset == 0 && roi.width == 0 && roi.height == 0;
  if (is_whole || info.width == 0 || info.height == 0) return;
  const std::uint64_t right = std::uint64_t{roi.x_offset} + roi.width, bottom = std::uint64_t{roi.y_offset} + roi.height;
  if (roi.width > 0 && roi.height > 0 && right <= info.width && bottom <= info.height) return;
  throw BadFrame("the region of interest in its camera_info, " + std::to_string(roi.width) + "x" + std::to_string(roi.height) +
                 " pixels at (" + std::to_string(roi.x_offset) + ", " + std::to_string(roi.y_offset) + "), is not within the sensor of " +
                 std::to_string(info.width) + "x" + std::to_string(info.height) + " pixels: correct it in the camera's driver");
}

}  // namespace

Intrinsics to_intrinsics(const sensor_msgs::CameraInfo& info) {
  check_region(info);
  sensor_msgs::CameraInfo rectified = info;
  if (info.P[0] == 0) rectified.P = {info.K[0], 0, info.K[2], 0, 0, info.K[4], info.K[5], 0, 0, 0, 1, 0};
  Intrinsics intrinsics;
  try {
    image_geometry::PinholeCameraModel model;  // applies binning and the region of interest
    model.fromCameraInfo(rectified);
    const cv::Size size = model.reducedResolution();
    intrinsics = {model.fx(), model.fy(), model.cx(), model.cy(), size.width, size.height};
  } catch (const std::exception& error) {
    throw BadFrame("its camera_info cannot be used (" + std::string(error.what()) + ")");
  }
  for (const double number : {intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy}) {
    if (!std::isfinite(number)) throw BadFrame("its camera_info is not finite");
  }
  if (!(intrinsics.fx > 0) || !(intrinsics.fy > 0)) throw BadFrame("its camera_info has no focal length");
  return intrinsics;
}

Intrinsics to_intrinsics(const sensor_msgs::CameraInfo& info, const cv::Size& image_size) {
  Intrinsics intrinsics = to_intrinsics(info);
  const cv::Size said(intrinsics.width, intrinsics.height);
  if (said.width > 0 && said.height > 0 && said != image_size) {
    throw BadFrame("the image has " + std::to_string(image_size.width) + "x" + std::to_string(image_size.height) +
                   " pixels, but its camera_info says " + std::to_string(said.width) + "x" + std::to_string(said.height));
  }
  intrinsics.width = image_size.width;
  intrinsics.height = image_size.height;
  return intrinsics;
}

sensor_msgs::CameraInfo to_camera_info(const Intrinsics& intrinsics) {
  sensor_msgs::CameraInfo info;
  info.width = static_cast<std::uint32_t>(intrinsics.width);
  info.height = static_cast<std::uint32_t>(intrinsics.height);
  info.distortion_model = "plumb_bob";
  info.D.assign(5, 0.0);
  info.K = {intrinsics.fx, 0, intrinsics.cx, 0, intrinsics.fy, intrinsics.cy, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {intrinsics.fx, 0, intrinsics.cx, 0, 0, intrinsics.fy, intrinsics.cy, 0, 0, 0, 1, 0};
  return info;
}

Eigen::Isometry3d to_isometry(const geometry_msgs::Transform& transform) {
  const Eigen::Quaterniond rotation(transform.rotation.w, transform.rotation.x, transform.rotation.y, transform.rotation.z);
  const Eigen::Vector3d translation(transform.translation.x, transform.translation.y, transform.translation.z);
  if (!translation.allFinite() || !rotation.coeffs().allFinite() || rotation.norm() < 1e-3) throw BadFrame("its pose is not finite");
  return Eigen::Translation3d(translation) * rotation.normalized();
}

Eigen::Isometry3d to_isometry(const geometry_msgs::Pose& pose) {
  geometry_msgs::Transform transform;
  transform.translation.x = pose.position.x;
  transform.translation.y = pose.position.y;
  transform.translation.z = pose.position.z;
  transform.rotation = pose.orientation;
  return to_isometry(transform);
}

Eigen::Vector3f to_vector(const geometry_msgs::Point& point) { return Eigen::Vector3d(point.x, point.y, point.z).cast<float>(); }

geometry_msgs::Pose to_pose(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond rotation(T.linear());
  geometry_msgs::Pose pose;
  pose.position = to_point(T.translation());
  pose.orientation.x = rotation.x();
  pose.orientation.y = rotation.y();
  pose.orientation.z = rotation.z();
  pose.orientation.w = rotation.w();
  return pose;
}

std::string late_stamp(const ros::Time& stamp) { return "its stamp of " + std::to_string(stamp.sec) + " s is later than in 2038"; }

std::string strip_slash(const std::string& name) {
  const std::size_t start = name.find_first_not_of('/');
  return start == std::string::npos ? std::string() : name.substr(start);
}

}  // namespace frontier_surfels::messages
