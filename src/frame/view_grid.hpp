/// The non-uniform voxel grid of a camera and its fixed tables - paper 3.1, supplement A.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/shared.h"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Range of pixels along a row or column: the first one, and one past the last one.
using PixelRange = std::array<std::uint16_t, 2>;

/// The grid and its tables. For each voxel along i and j of the cuboid's layers they give the range of the working image's pixels whose
/// samples lie in the voxel; the range may be empty. The tables have whole 64-bit words of layers and whole chunks of TABLE_CHUNK voxels.
struct ViewGrid {
  Grid grid = {};
  std::vector<float> layer_depth;    ///< [size_k]: z of each layer's centre [m]
  std::vector<PixelRange> pixels_i;  ///< [layers][chunks][TABLE_CHUNK]: range of columns for each voxel along i
  std::vector<PixelRange> pixels_j;  ///< [layers][chunks][TABLE_CHUNK]: range of rows for each voxel along j
  std::vector<PixelRange> words_i;   ///< [layers][chunks]: range of 32-pixel words with the columns of a chunk
};

/// @param intrinsics  of the working image
/// @throws BadFrame  the grid would be too large
ViewGrid make_view_grid(const Intrinsics& intrinsics, const Config& config);

}  // namespace frontier_surfels
