/// How the pixels of depth images are read: the mapper, and what counts their faults, must agree.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Value of a 16-bit pixel that sensors write, as they write 0, where they have measured nothing.
constexpr std::uint16_t kSaturated = 65535;

inline std::uint16_t swapped(std::uint16_t value) { return __builtin_bswap16(value); }
inline std::uint32_t swapped(std::uint32_t value) { return __builtin_bswap32(value); }

/// Depth of a 16-bit pixel [m]; 0: no measurement. @param depth_unit  Config::depth_unit
inline float to_metres(std::uint16_t steps, double depth_unit) {
  // kSaturated becomes 0, and all others stay as they are, without a choice: of one, the compiler makes masks of 64 bits
  const auto next = static_cast<std::uint16_t>(steps + 1);
  static_assert(static_cast<std::uint16_t>(kSaturated + 1) == 0);
  const auto measured = static_cast<std::uint16_t>(std::max<std::uint16_t>(next, 1) - 1);
  return static_cast<float>(measured * depth_unit);
}

/// Depth of a pixel whose bits are a float [m].
inline float to_metres(std::uint32_t bits, double /*depth_unit*/) {
  float metres;
  std::memcpy(&metres, &bits, sizeof(metres));
  return metres;
}

/// The pixel whose bytes begin at `bytes`.
template <typename Pixel>
Pixel pixel_at(const std::uint8_t* bytes, bool swap_bytes) {
  Pixel pixel;
  std::memcpy(&pixel, bytes, sizeof(pixel));
  return swap_bytes ? swapped(pixel) : pixel;
}

/// See read_row().
template <typename Pixel, bool kSwapBytes, typename Meaning>
void read_row_as(const std::uint8_t* bytes, int width, double depth_unit, const Meaning meaning, float* __restrict__ values) {
  for (int column = 0; column < width; ++column)
    values[column] = meaning(to_metres(pixel_at<Pixel>(bytes + column * sizeof(Pixel), kSwapBytes), depth_unit));
}

/// Writes meaning(depth [m]) of each pixel of a row to values[image.width]. What is the same for all pixels is decided before the loop over
/// them, so that the compiler makes vectors of it.
/// @tparam Pixel  unsigned integer of the image's pixel size
template <typename Pixel, typename Meaning>
void read_row(const DepthImage& image, int row, double depth_unit, const Meaning& meaning, float* values) {
  const auto* bytes = static_cast<const std::uint8_t*>(image.data) + row * image.step;
  if (image.swap_bytes)
    read_row_as<Pixel, true>(bytes, image.width, depth_unit, meaning, values);
  else
    read_row_as<Pixel, false>(bytes, image.width, depth_unit, meaning, values);
}

/// Calls visit(pixel) for the upper left pixel of every whole block of decimation x decimation pixels, row by row.
/// @tparam Pixel  unsigned integer of the image's pixel size
template <typename Pixel, typename Visit>
void for_each_pixel(const DepthImage& image, int decimation, Visit visit) {
  const int width = image.width / decimation, height = image.height / decimation;
  for (int t = 0; t < height; ++t) {
    const auto* row = static_cast<const std::uint8_t*>(image.data) + t * decimation * image.step;
    for (int s = 0; s < width; ++s, row += decimation * sizeof(Pixel)) visit(pixel_at<Pixel>(row, image.swap_bytes));
  }
}

}  // namespace frontier_surfels
