/// The working image with `sampling: mean`, as the yardsticks read it. It follows the words of Sampling (src/frame/sampling.hpp), one after
/// the other, and shares no code with it.
#pragma once

#include <vector>

#include "scoring/depth_reading.hpp"

namespace frontier_surfels::scoring {

/// Raw depths of an image [m], any float.
struct RawDepths {
  int width, height;
  std::vector<float> depth;  ///< depth[height][width]
};

/// @return depth[height / decimation][width / decimation] [m]; see DecimatedDepth::depth
std::vector<float> mean_depths(const RawDepths& raw, const DepthReading& reading);

}  // namespace frontier_surfels::scoring
