/// raw_frames RECORDING FILE [FRAMES]: writes the first frames of a recording (a folder or a bag), 100 by default, as raw_frames.hpp has
/// them.
#include "device/raw_frames.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "frontier_surfels/config.hpp"
#include "recordings/frame_source.hpp"
#include "scoring/decimated_depth.hpp"

namespace {

using namespace frontier_surfels;

std::uint16_t steps(float metres) {
  const double steps = metres / kRawDepthUnit;
  return steps >= 0.5 && steps < 65535 ? static_cast<std::uint16_t>(std::lround(steps)) : 0;  // NaN and Inf are no measurement
}

RawFrame raw(const replay::RecordedFrame& frame) {
  const DepthImage depth = frame.view().depth;
  RawFrame out{frame.stamp, frame.T_world_camera, {}};
  for (int row = 0; row < depth.height; ++row)
    for (int column = 0; column < depth.width; ++column)
      out.depth.push_back(steps(scoring::read_depth(depth, column, row, Config().depth_unit)));
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || argc > 4) {
    std::fprintf(stderr, "usage: raw_frames RECORDING FILE [FRAMES]\n");
    return 2;
  }
  try {
    replay::SourceOptions options;
    options.last = (argc > 3 ? std::atoi(argv[3]) : 100) - 1;
    options.color_topic = "none";
    const auto source = replay::open_source(argv[1], options);
    RawFrames all;
    while (const auto frame = source->next()) {
      all.intrinsics = frame->intrinsics;
      all.frames.push_back(raw(*frame));
    }
    write_raw_frames(argv[2], all);
    std::printf("%zu frames of %d x %d pixels in %s\n", all.frames.size(), all.intrinsics.width, all.intrinsics.height, argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "raw_frames: %s\n", error.what());
    return 1;
  }
}
