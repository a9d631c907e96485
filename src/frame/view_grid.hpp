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

/// Largest number of a grid's voxels, which are numbered with 32 bits.
constexpr double kMaxVoxels = 2e9;

/// The intrinsics of every step-th pixel in both directions.
Intrinsics decimated(const Intrinsics& full, int step);

/// Checks the size of the grid of a depth image, before memory is asked for. The sentence says which decimation would do.
/// @param full        intrinsics before decimation
/// @param max_voxels  for which there is memory, at most kMaxVoxels
/// @throws BadFrame
void check_grid_size(const Intrinsics& full, const Config& config, double max_voxels);

/// @param intrinsics  of the working image, of a size that check_grid_size() accepts
ViewGrid make_view_grid(const Intrinsics& intrinsics, const Config& config);

}  // namespace frontier_surfels
