#include "frontier_surfels/depth_census.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace frontier_surfels {
namespace {

constexpr float kMetresPerUnit = 0.001F;  // of 16-bit images
constexpr float kImplausible = 100;       // [m]; no depth camera measures as far, so that such a depth is in another unit
constexpr std::uint16_t kSaturated = 65535;

std::uint16_t swapped(std::uint16_t value) { return __builtin_bswap16(value); }
std::uint32_t swapped(std::uint32_t value) { return __builtin_bswap32(value); }

void count_depth(float depth, const Config& config, DepthCensus& census) {
  if (std::isnan(depth) || depth <= 0) {
    ++census.missing;
    return;
  }
  census.nearest = std::min(census.nearest, depth);
  if (std::isfinite(depth)) census.farthest = std::max(census.farthest, depth);
  const bool carves = std::isinf(depth) ? config.carve_no_return : config.carve_beyond_range && depth < kImplausible;
  if (depth < static_cast<float>(config.z_min)) {
    ++census.too_near;
  } else if (depth <= static_cast<float>(config.z_max) || carves) {
    ++census.usable;
  } else {
    ++census.too_far;
  }
}

void count_pixel(std::uint16_t value, const Config& config, DepthCensus& census) {
  if (value == kSaturated) {
    ++census.saturated;
  } else {
    count_depth(static_cast<float>(value) * kMetresPerUnit, config, census);
  }
}

void count_pixel(std::uint32_t bits, const Config& config, DepthCensus& census) {
  float depth;
  std::memcpy(&depth, &bits, sizeof(depth));
  count_depth(depth, config, census);
}

/// @tparam Pixel  unsigned integer of the image's pixel size
template <typename Pixel>
void count_pixels(const DepthImage& image, const Config& config, DepthCensus& census) {
  const std::size_t step = static_cast<std::size_t>(config.decimation);
  const std::size_t width = static_cast<std::size_t>(image.width) / step, height = static_cast<std::size_t>(image.height) / step;
  for (std::size_t t = 0; t < height; ++t) {
    const auto* row = static_cast<const std::uint8_t*>(image.data) + t * step * image.step;
    for (std::size_t s = 0; s < width; ++s) {
      Pixel pixel;
      std::memcpy(&pixel, row + s * step * sizeof(Pixel), sizeof(Pixel));
      count_pixel(image.swap_bytes ? swapped(pixel) : pixel, config, census);
    }
  }
}

}  // namespace

std::string DepthCensus::reason() const {
  if (usable > 0) return {};
  if (measured() == 0) return "no_measurement";
  if (saturated == measured()) return "saturated";
  if (too_near > 0 && too_far == 0) return "too_near";
  if (too_far > 0 && too_near == 0) return "too_far";
  return "out_of_range";
}

DepthCensus& DepthCensus::operator+=(const DepthCensus& other) {
  usable += other.usable;
  missing += other.missing;
  saturated += other.saturated;
  too_near += other.too_near;
  too_far += other.too_far;
  in_metres = other.in_metres;
  nearest = std::min(nearest, other.nearest);
  farthest = std::max(farthest, other.farthest);
  return *this;
}

DepthCensus count_depths(const DepthImage& image, const Config& config) {
  DepthCensus census;
  census.in_metres = image.encoding == DepthImage::Encoding::kMetresF32;
  if (census.in_metres) {
    count_pixels<std::uint32_t>(image, config, census);
  } else {
    count_pixels<std::uint16_t>(image, config, census);
  }
  return census;
}

}  // namespace frontier_surfels
