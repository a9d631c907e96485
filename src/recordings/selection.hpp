/// The frames of a recording that are read.
#pragma once

#include <cstddef>
#include <string>

#include "recordings/frame_source.hpp"

namespace frontier_surfels::replay {

/// The `count` frames first, first + stride, first + 2 stride, ... of a recording.
struct Selection {
  std::size_t first = 0;
  std::size_t count = 0;
  std::size_t stride = 1;
};

/// Applies first, last and stride to a recording of `frames` frames. @throws Error if no frame is
/// left, or the options contradict each other
Selection select_frames(const SourceOptions& options, std::size_t frames, const std::string& path);

}  // namespace frontier_surfels::replay
