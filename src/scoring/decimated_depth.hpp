/// Depth images at working resolution, as the yardsticks use them.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "scoring/depth_reading.hpp"
#include "scoring/mean_depths.hpp"

namespace frontier_surfels::scoring {

/// Every `decimation`-th pixel of a depth image, and the camera that would have taken it.
struct DecimatedDepth {
  Intrinsics intrinsics;
  std::vector<float> depth;  ///< depth[height][width] [m]: > 0 a surface, < 0 free space up to -depth, 0 no measurement
};

/// @throws BadFrame unless the frame has pixels, a camera and a rigid, finite pose
inline void check_frame(const DepthFrame& frame) {
  const DepthImage& image = frame.depth;
  const Intrinsics& camera = frame.intrinsics;
  const std::size_t pixel_size = image.encoding == DepthImage::Encoding::kStepsU16 ? sizeof(std::uint16_t) : sizeof(float);
  if (image.data == nullptr || image.width <= 0 || image.height <= 0) throw BadFrame("The depth image has no pixels; give one with data.");
  if (image.step < image.width * pixel_size) throw BadFrame("The depth image's step is shorter than a row of pixels; correct the step.");
  if (camera.width != image.width || camera.height != image.height) {
    throw BadFrame("The intrinsics are of another image size than the depth image; give those of this image.");
  }
  if (!(std::isfinite(camera.fx) && std::isfinite(camera.fy) && camera.fx > 0 && camera.fy > 0 && std::isfinite(camera.cx) &&
        std::isfinite(camera.cy))) {
    throw BadFrame("The intrinsics are not those of a pinhole camera (fx, fy > 0, all finite); give calibrated ones.");
  }
  if (!frame.T_world_camera.matrix().allFinite() || !frame.T_world_camera.linear().isUnitary(1e-3)) {
    throw BadFrame("The frame's pose is missing or not rigid; give T_world_camera.");
  }
}

/// The value at `bytes`, whose order is reversed if `swap_bytes`.
template <typename T>
T read_pixel(const unsigned char* bytes, bool swap_bytes) {
  unsigned char copy[sizeof(T)];
  std::memcpy(copy, bytes, sizeof(T));
  if (swap_bytes) {
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(copy[i], copy[sizeof(T) - 1 - i]);
  }
  T value;
  std::memcpy(&value, copy, sizeof(T));
  return value;
}

/// Depth at a pixel [m], as the image has it: any float, NaN and Inf included. Of 16 bits, 65535 is no measurement, like 0.
inline float read_depth(const DepthImage& image, int column, int row, double depth_unit) {
  const auto* line = static_cast<const unsigned char*>(image.data) + static_cast<std::size_t>(row) * image.step;
  if (image.encoding == DepthImage::Encoding::kStepsU16) {
    const auto steps = read_pixel<std::uint16_t>(line + column * sizeof(std::uint16_t), image.swap_bytes);
    return steps == 65535 ? 0 : static_cast<float>(steps * depth_unit);
  }
  return read_pixel<float>(line + column * sizeof(float), image.swap_bytes);
}

/// Pixel (s, t) is (decimation s, decimation t) of the image, or the mean of those around it.
inline DecimatedDepth decimate(const DepthFrame& frame, const DepthReading& reading) {
  check_frame(frame);
  const int n = reading.decimation;
  const Intrinsics& full = frame.intrinsics;
  DecimatedDepth result{{full.fx / n, full.fy / n, full.cx / n, full.cy / n, full.width / n, full.height / n}, {}};
  if (reading.means && n > 1) {
    std::vector<float> full_depth;
    full_depth.reserve(static_cast<std::size_t>(full.width) * full.height);
    for (int row = 0; row < full.height; ++row)
      for (int column = 0; column < full.width; ++column) full_depth.push_back(read_depth(frame.depth, column, row, reading.depth_unit));
    result.depth = mean_depths({full.width, full.height, std::move(full_depth)}, reading);
    return result;
  }
  result.depth.reserve(static_cast<std::size_t>(result.intrinsics.width) * result.intrinsics.height);
  for (int t = 0; t < result.intrinsics.height; ++t)
    for (int s = 0; s < result.intrinsics.width; ++s)
      result.depth.push_back(meaning(read_depth(frame.depth, n * s, n * t, reading.depth_unit), reading));
  return result;
}

}  // namespace frontier_surfels::scoring
