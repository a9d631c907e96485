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

/// Pixels whose samples of the cuboid's layers lie in each voxel along an axis; layers are filled up to whole words of the bit fields.
struct CuboidPixels {
  std::vector<PixelRange> of_layer;   ///< [layers][size]: empty where there are none
  std::vector<PixelRange> of_run;     ///< [layers / LAYER_RUN][size]: the smallest range around those of the run
  std::vector<std::uint64_t> layers;  ///< [layers / 64][size]: bits of the layers that have any
};

struct ViewGrid {
  Grid grid = {};
  std::vector<float> layer_depth;  ///< [size_k]: z of each layer's centre [m]
  CuboidPixels columns;            ///< of the working image, where its samples lie along i
  CuboidPixels rows;               ///< along j
};

/// @param intrinsics  of the working image
/// @throws BadFrame  the grid would be too large
ViewGrid make_view_grid(const Intrinsics& intrinsics, const Config& config);

}  // namespace frontier_surfels
