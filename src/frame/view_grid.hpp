/// The non-uniform voxel grid of a camera and its fixed tables - paper 3.1, supplement A.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/shared.h"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// First and one past the last pixel of a row or column.
using PixelRange = std::array<std::uint16_t, 2>;

/// pixels: of the working image, those whose samples of the cuboid's layers lie in each voxel along an axis; empty where there are none.
/// Layers are filled up to whole words of the bit fields, and voxels to whole chunks of TABLE_CHUNK.
struct ViewGrid {
  Grid grid = {};
  std::vector<float> layer_depth;    ///< [size_k]: z of each layer's centre [m]
  std::vector<PixelRange> pixels_i;  ///< [layers][chunks][TABLE_CHUNK]: columns
  std::vector<PixelRange> pixels_j;  ///< [layers][chunks][TABLE_CHUNK]: rows
  std::vector<PixelRange> words_i;   ///< [layers][chunks]: words of 32 pixels that the columns of a chunk lie in
};

/// @param intrinsics  of the working image
/// @throws BadFrame  the grid would be too large
ViewGrid make_view_grid(const Intrinsics& intrinsics, const Config& config);

}  // namespace frontier_surfels
