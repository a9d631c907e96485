/// A frame, checked and reduced to what the method works on.
#pragma once

#include <cstdint>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

struct WorkingImage {
  Intrinsics intrinsics;             ///< of the decimated image
  std::vector<float> depth;          ///< depth[height][width] [m]: > 0 surface, < 0 nothing up to -depth, 0 no measurement
  std::vector<std::uint32_t> color;  ///< [height][width]: red | green << 8 | blue << 16; empty if the frame has none
};

/// Are these the intrinsics of the same camera?
bool same_camera(const Intrinsics& a, const Intrinsics& b);

/// Every decimation-th pixel of both directions, nearest neighbour; intrinsics divided alike.
/// @throws BadFrame  a sentence that names what is wrong with the frame
WorkingImage make_working_image(const DepthFrame& frame, const Config& config);

}  // namespace frontier_surfels
