#include "bag_messages.hpp"

#include <boost/predef/other/endian.h>
#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>

namespace frontier_surfels::replay {
namespace {

namespace encodings = sensor_msgs::image_encodings;
constexpr bool kThisMachineIsBigEndian = BOOST_ENDIAN_BIG_BYTE;

/// Checks that an image has the bytes that its size asks for. In 64 bits: damaged sizes overflow 32.
void check_size(const sensor_msgs::Image& image, std::size_t bytes_per_pixel) {
  const std::uint64_t bytes = static_cast<std::uint64_t>(image.step) * image.height;
  if (image.width == 0 || image.height == 0) throw BadFrame("the image is empty");
  if (image.data.size() != bytes) {
    throw BadFrame("the image has " + std::to_string(image.data.size()) + " bytes instead of " + std::to_string(bytes));
  }
  if (image.step < static_cast<std::uint64_t>(image.width) * bytes_per_pixel) throw BadFrame("the image's step is shorter than its rows");
}

/// Copies depth into rows without gaps and into this machine's byte order. cv_bridge does not: it gives two channels of bytes where the
/// order differs.
cv::Mat unpack_depth(const sensor_msgs::Image& image, int type) {
  const std::size_t size = CV_ELEM_SIZE(type);
  check_size(image, size);
  cv::Mat depth(static_cast<int>(image.height), static_cast<int>(image.width), type);
  const bool swap = static_cast<bool>(image.is_bigendian) != kThisMachineIsBigEndian;
  for (int row = 0; row < depth.rows; ++row) {
    std::uint8_t* values = depth.ptr(row);
    std::memcpy(values, &image.data[static_cast<std::size_t>(row) * image.step], size * image.width);
    if (!swap) continue;
    for (std::uint32_t column = 0; column < image.width; ++column) std::reverse(values + size * column, values + size * (column + 1));
  }
  return depth;
}

cv::Mat unpack_color(const sensor_msgs::Image& image) {
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
  return metres_from_inverse(values, header.quantisation);
}

}  // namespace

cv::Mat depth_image(const ImageMessage& message) {
  if (message.compressed) return decode_depth(*message.compressed);
  const std::string& encoding = message.raw->encoding;
  if (encoding == encodings::TYPE_16UC1 || encoding == encodings::MONO16) return unpack_depth(*message.raw, CV_16UC1);
  if (encoding == encodings::TYPE_32FC1) return unpack_depth(*message.raw, CV_32FC1);
  throw BadFrame("the encoding '" + encoding + "' is not one of depth (16UC1, mono16, 32FC1)");
}

cv::Mat color_image(const ImageMessage& message) {
  if (message.raw) return unpack_color(*message.raw);
  return decode(message.compressed->data.data(), message.compressed->data.size(), cv::IMREAD_COLOR);
}

Intrinsics to_intrinsics(const sensor_msgs::CameraInfo& info) {
  const bool rectified = info.P[0] != 0;
  Intrinsics intrinsics;
  intrinsics.fx = rectified ? info.P[0] : info.K[0];
  intrinsics.fy = rectified ? info.P[5] : info.K[4];
  intrinsics.cx = rectified ? info.P[2] : info.K[2];
  intrinsics.cy = rectified ? info.P[6] : info.K[5];
  for (const double number : {intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy}) {
    if (!std::isfinite(number)) throw BadFrame("its camera_info is not finite");
  }
  if (!(intrinsics.fx > 0) || !(intrinsics.fy > 0)) throw BadFrame("its camera_info has no focal length");

  // The region of interest is given in pixels before binning; 0 means no binning, and a region of no size the whole image.
  const int binning_x = static_cast<int>(std::max(1u, info.binning_x));
  const int binning_y = static_cast<int>(std::max(1u, info.binning_y));
  intrinsics.fx /= binning_x;
  intrinsics.fy /= binning_y;
  intrinsics.cx = (intrinsics.cx - info.roi.x_offset) / binning_x;
  intrinsics.cy = (intrinsics.cy - info.roi.y_offset) / binning_y;
  intrinsics.width = static_cast<int>(info.roi.width ? info.roi.width : info.width) / binning_x;
  intrinsics.height = static_cast<int>(info.roi.height ? info.roi.height : info.height) / binning_y;
  return intrinsics;
}

std::string strip_slash(const std::string& name) {
  const std::size_t start = name.find_first_not_of('/');
  return start == std::string::npos ? std::string() : name.substr(start);
}

}  // namespace frontier_surfels::replay
