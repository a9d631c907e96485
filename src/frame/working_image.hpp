/// The working image: a frame's depths and colours after checking and decimation.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "frame/row_workers.hpp"
#include "frame/sampling.hpp"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

struct WorkingImage {
  Intrinsics intrinsics;             ///< of the decimated image
  std::vector<float> depth;          ///< depth[height][width] [m]: > 0 surface, < 0 free space up to -depth, 0 no measurement
  std::vector<std::uint32_t> color;  ///< [height][width]: red | green << 8 | blue << 16; empty if the frame has none

  std::size_t measured_pixels() const;  ///< see Report
};

/// What successive images are made with: threads, and memory, because new memory costs more than what is written to it.
struct SamplingRoom {
  explicit SamplingRoom(const Config& config) : workers(config.threads) {}

  RowWorkers workers;
  SampledDepth sampled;  ///< of the last image
};

/// Are these the intrinsics of the same camera?
bool same_camera(const Intrinsics& a, const Intrinsics& b);

/// Takes every decimation-th pixel in both directions, or the mean of the pixels around it (sampling.hpp), and divides the intrinsics by
/// the decimation.
/// @param max_voxels  see check_grid_size()
/// @throws BadFrame  a sentence that names what is wrong with the frame
WorkingImage make_working_image(const DepthFrame& frame, const Config& config, double max_voxels, SamplingRoom& room);

/// The working image of a saved view.
WorkingImage working_image_of(const SavedView& view);

}  // namespace frontier_surfels
