/// What is mapped: a recording or the synthetic room.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bench/options.hpp"
#include "recordings/frame_source.hpp"

namespace frontier_surfels::bench {

/// An input that can be read from its beginning any number of times.
class Input {
 public:
  /// @param path    a bag or a folder; empty: the synthetic room
  /// @throws Error  if it cannot be read, or has no usable frame
  Input(const std::string& path, const Options& options);

  const std::string& path() const { return path_; }
  const std::string& name() const { return name_; }

  /// @param frames  number of frames, evenly spaced over those that the options select; 0: all of these
  std::unique_ptr<replay::FrameSource> open(int frames = 0) const;

  /// The base configuration with the decimation that makes images about `width` pixels wide.
  Config config(int width) const;

  /// Size of the images after decimation [pixel].
  int width(const Config& config) const { return camera_.width / config.decimation; }
  int height(const Config& config) const { return camera_.height / config.decimation; }

 private:
  std::string path_, name_;
  replay::SourceOptions selection_;
  int synthetic_frames_ = 0;
  Intrinsics camera_;  ///< of the images as recorded
  Config base_;
};

std::vector<Input> open_inputs(const Options& options);

}  // namespace frontier_surfels::bench
