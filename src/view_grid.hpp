/// The non-uniform voxel grid of a camera and its fixed tables - paper 3.1, supplement A.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "0_shared.h"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// First and one past the last pixel of a row or column.
using PixelRange = std::array<std::uint16_t, 2>;

struct ViewGrid {
  Grid grid = {};
  std::vector<float> layer_depth;    ///< [size_k]: z of each layer's centre [m]
  std::vector<PixelRange> pixels_i;  ///< [first_pyramid_layer][size_i]: columns of pixels whose sample of the cuboid's layer lies at i
  std::vector<PixelRange> pixels_j;  ///< [first_pyramid_layer][size_j]: rows, at j
};

/// @param intrinsics  of the working image
/// @throws BadFrame  the grid would be too large
ViewGrid make_view_grid(const Intrinsics& intrinsics, const Config& config);

}  // namespace frontier_surfels
