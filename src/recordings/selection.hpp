/// Which frames of a recording are read.
#pragma once

#include <cstddef>
#include <string>

#include "recordings/frame_source.hpp"

namespace frontier_surfels::replay {

/// Frames first, first + stride, ... of a recording: `count` of them.
struct Selection {
  std::size_t first = 0;
  std::size_t count = 0;
  std::size_t stride = 1;
};

/// Applies first, last and stride to a recording of `frames` frames. @throws Error if nothing is left, or the options make no sense
Selection select_frames(const SourceOptions& options, std::size_t frames, const std::string& path);

}  // namespace frontier_surfels::replay
