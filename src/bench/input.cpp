#include "bench/input.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "synthetic/synthetic_room.hpp"

namespace frontier_surfels::bench {
namespace {

constexpr int kDefaultSyntheticFrames = 100;

/// The synthetic room with a Kinect's noise. Frames are rendered when they are asked for, so that no stored images count as memory.
class SyntheticSource : public replay::FrameSource {
 public:
  /// @param frames  number of frames of the whole way around the table
  SyntheticSource(int frames, const replay::SourceOptions& selection, const Intrinsics& camera)
      : frames_(frames), stride_(selection.stride), end_(selection.last < 0 ? frames : selection.last + 1), camera_(camera) {}

  std::size_t size() const override { return (end_ + stride_ - 1) / stride_; }
  std::optional<replay::RecordedFrame> next() override {
    if (next_ >= end_) return std::nullopt;
    replay::SensorModel sensor;
    sensor.noise = true;
    sensor.dropouts = 0.05;
    auto frame = room_.render(next_, frames_, camera_, sensor);
    next_ += stride_;
    return frame;
  }
  const std::vector<std::string>& skipped() const override { return none_; }
  const std::vector<std::string>& notes() const override { return none_; }

 private:
  replay::Room room_;
  int next_ = 0;
  int frames_, stride_, end_;
  Intrinsics camera_;
  std::vector<std::string> none_;
};

std::string last_part(const std::string& path) {
  const std::filesystem::path whole = std::filesystem::path(path).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

}  // namespace

Input::Input(const std::string& path, const Options& options)
    : path_(path), name_(path.empty() ? "synthetic room" : last_part(path)), base_(options.config) {
  if (options.frames > 0) selection_.last = options.frames - 1;
  if (path.empty()) {
    synthetic_frames_ = options.frames > 0 ? options.frames : kDefaultSyntheticFrames;
    camera_ = options.quick ? replay::synthetic_camera(80, 60) : replay::synthetic_camera();
    return;
  }
  const auto source = open();
  const auto first = source->next();
  if (!first) {
    const auto& skipped = source->skipped();
    throw Error("No frame of '" + path + "' could be used" + (skipped.empty() ? "." : ", the first because: " + skipped.front()));
  }
  camera_ = first->intrinsics;
}

std::unique_ptr<replay::FrameSource> Input::open(int frames) const {
  replay::SourceOptions selection = selection_;
  if (frames > 0) {
    const int all = path_.empty() ? synthetic_frames_ : static_cast<int>(replay::open_source(path_, selection)->size());
    selection.stride = std::max(1, all / frames);
    selection.last = selection.stride * (std::min(frames, all) - 1);
  }
  if (!path_.empty()) return replay::open_source(path_, selection);
  return std::make_unique<SyntheticSource>(synthetic_frames_, selection, camera_);
}

Config Input::config(int width) const {
  Config config = base_;
  config.decimation = std::max(1, static_cast<int>(std::lround(static_cast<double>(camera_.width) / width)));
  return config;
}

std::vector<Input> open_inputs(const Options& options) {
  if (options.inputs.empty()) return {Input("", options)};
  std::vector<Input> inputs;
  for (const std::string& path : options.inputs) inputs.emplace_back(path, options);
  return inputs;
}

}  // namespace frontier_surfels::bench
