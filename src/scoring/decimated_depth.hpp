/// Depth images at working resolution, as the yardsticks use them.
#pragma once

#include <cmath>
#include <cstring>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "config/config_text.hpp"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

/// Every `decimation`-th pixel of a depth image, and the camera that would have taken it.
struct DecimatedDepth {
  Intrinsics intrinsics;
  std::vector<float> depth;  ///< depth[height][width] [m]: > 0 a surface, < 0 free space up to -depth, 0 no measurement
};

/// The parameters that say how depth images are read.
struct DepthReading {
  double z_min = 0;           ///< [m]
  double z_max = 0;           ///< [m]
  int decimation = 1;         ///< [pixel]
  double depth_unit = 0.001;  ///< [m]
  bool carve_no_return = false;
  bool carve_beyond_range = false;

  /// @throws Error if the numbers make no sense
  explicit DepthReading(const Config& config)
      : z_min(config.z_min),
        z_max(config.z_max),
        decimation(config.decimation),
        depth_unit(config.depth_unit),
        carve_no_return(config.carve_no_return),
        carve_beyond_range(config.carve_beyond_range) {
    if (!(z_min > 0 && z_max > z_min && std::isfinite(z_max))) {
      throw Error("The depth range must be 0 < z_min < z_max, but is " + to_text(z_min) + " to " + to_text(z_max) + " m.");
    }
    if (!(depth_unit > 0 && std::isfinite(depth_unit))) {
      throw Error("The depth unit must be above 0, but is " + to_text(depth_unit) + " m.");
    }
    if (decimation < 1) throw Error("The decimation must be 1 or more, but is " + std::to_string(decimation) + ".");
  }

  bool operator==(const DepthReading& other) const {
    const auto all = [](const DepthReading& r) {
      return std::tuple(r.z_min, r.z_max, r.decimation, r.depth_unit, r.carve_no_return, r.carve_beyond_range);
    };
    return all(*this) == all(other);
  }
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

/// What a raw depth [m] says; see DecimatedDepth::depth. The limits are compared as floats, like the depths.
inline float meaning(float d, const DepthReading& reading) {
  const float z_min = static_cast<float>(reading.z_min), z_max = static_cast<float>(reading.z_max);
  if (d >= z_min && d <= z_max) return d;
  if (!(d > z_max)) return 0;
  return (std::isinf(d) ? reading.carve_no_return : reading.carve_beyond_range) ? -z_max : 0;
}

/// Nearest neighbour: pixel (s, t) is (decimation s, decimation t) of the image.
inline DecimatedDepth decimate(const DepthFrame& frame, const DepthReading& reading) {
  check_frame(frame);
  const int n = reading.decimation;
  const Intrinsics& full = frame.intrinsics;
  DecimatedDepth result{{full.fx / n, full.fy / n, full.cx / n, full.cy / n, full.width / n, full.height / n}, {}};
  result.depth.reserve(static_cast<std::size_t>(result.intrinsics.width) * result.intrinsics.height);
  for (int t = 0; t < result.intrinsics.height; ++t) {
    for (int s = 0; s < result.intrinsics.width; ++s)
      result.depth.push_back(meaning(read_depth(frame.depth, n * s, n * t, reading.depth_unit), reading));
  }
  return result;
}

}  // namespace frontier_surfels::scoring
