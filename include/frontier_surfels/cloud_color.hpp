/// The colour of a surfel in point clouds, packed as PCL's rgb: 0x00rrggbb.
#pragma once

#include <array>
#include <cstdint>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

constexpr std::uint32_t kFrontierColor = 0x0000ff;  ///< blue
constexpr std::uint32_t kOccupiedColor = 0x808080;  ///< grey

/// In the alpha byte: the surfel has no colour of its own, and shows that of its label.
constexpr std::uint32_t kColorOfLabel = 0x01000000;

/// The surfel's own colour, or where it has none that of its label, marked by kColorOfLabel.
inline std::uint32_t to_cloud_color(const Surfel& surfel) {
  const auto [red, green, blue] = surfel.rgb;
  const std::uint32_t own = std::uint32_t{red} << 16 | std::uint32_t{green} << 8 | blue;
  if (own != 0) return own;
  return kColorOfLabel | (surfel.label == Label::kFrontier ? kFrontierColor : kOccupiedColor);
}

/// Surfel::rgb: the inverse of to_cloud_color. Colours with any other alpha byte are the surfel's own.
inline std::array<std::uint8_t, 3> from_cloud_color(std::uint32_t color) {
  if (color >> 24 == kColorOfLabel >> 24) return {0, 0, 0};
  return {static_cast<std::uint8_t>(color >> 16), static_cast<std::uint8_t>(color >> 8), static_cast<std::uint8_t>(color)};
}

}  // namespace frontier_surfels
