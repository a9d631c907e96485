/// Depth frames and surfels for the tests of the exact test.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

using Eigen::Vector3d;
using Encoding = DepthImage::Encoding;

/// The default configuration with another depth range [m] and decimation.
inline Config reading(double z_min, double z_max, int decimation) {
  Config config;
  config.z_min = z_min;
  config.z_max = z_max;
  config.decimation = decimation;
  return config;
}

/// The same with the nearest pixels, not the means of those around them.
inline Config nearest_reading(double z_min, double z_max, int decimation) {
  Config config = reading(z_min, z_max, decimation);
  config.sampling = "nearest";
  return config;
}

/// A depth frame that owns its image's bytes, laid out as a driver would deliver them.
struct OwnedFrame {
  std::vector<unsigned char> bytes;
  DepthFrame frame;

  OwnedFrame(const Intrinsics& camera, const Eigen::Isometry3d& T_world_camera, Encoding encoding, std::size_t padding, bool swap_bytes) {
    const std::size_t size = pixel_size(encoding);
    frame.intrinsics = camera;
    frame.T_world_camera = T_world_camera;
    frame.depth = {camera.width, camera.height, camera.width * size + padding, encoding, nullptr, swap_bytes};
    bytes.assign(frame.depth.step * camera.height, 0xA5);
  }

  static std::size_t pixel_size(Encoding encoding) { return encoding == Encoding::kStepsU16 ? 2 : 4; }

  void set(int column, int row, double metres) {
    const std::size_t size = pixel_size(frame.depth.encoding);
    unsigned char* pixel = bytes.data() + row * frame.depth.step + column * size;
    const auto millimetres = static_cast<std::uint16_t>(std::isfinite(metres) && metres > 0 ? std::lround(metres * 1000) : 0);
    const auto value = static_cast<float>(metres);
    std::memcpy(pixel, size == 2 ? static_cast<const void*>(&millimetres) : &value, size);
    if (frame.depth.swap_bytes) std::reverse(pixel, pixel + size);
  }

  const DepthFrame& view() {
    frame.depth.data = bytes.data();
    return frame;
  }
};

inline Surfel make_surfel(const Vector3d& position, const Vector3d& normal, double radius = 0.01, Label label = Label::kFrontier) {
  Surfel surfel;
  surfel.position = position.cast<float>();
  surfel.normal = normal.normalized().cast<float>();
  surfel.radius = static_cast<float>(radius);
  surfel.label = label;
  return surfel;
}

}  // namespace frontier_surfels::scoring
