/// Runs over whole frames, with the same code as in replay_score.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>

#include "bench/input.hpp"
#include "bench/options.hpp"
#include "replay/run.hpp"

namespace frontier_surfels::bench {

/// Width of the working image where a section does not vary it: a quarter of a Kinect's.
constexpr int kUsualWidth = 160;

using AfterFrame = std::function<void(const DepthFrame&, replay::FrameRecord&)>;

/// The map of an input is empty, so that its figures mean nothing. The message is that of replay_score.
struct EmptyMap : Error {
  using Error::Error;
};

/// Maps frames until there are no more, options.row_seconds have passed, or Ctrl-C is pressed.
/// @param source  frames of `input`
/// @throws Error  if no frame could be used. @throws EmptyMap
replay::Run run_frames(Mapper& mapper, const Input& input, replay::FrameSource& source, const Options& options,
                       const AfterFrame& after_frame = {});

/// Memory on the device besides the map and what has been seen.
std::size_t working_memory(const Report& report);

/// Adds the number of frames, the times without the first frames, the number of surfels, the memory, and warnings about the
/// recording if there are any, to `row`.
void add_figures(const replay::Run& run, nlohmann::ordered_json& row);

/// @param values  not empty
nlohmann::ordered_json statistics_json(const std::vector<double>& values);

/// Runs `measure`. If it throws, as when the device is too small, the message goes to row["error"], and other rows can still be measured.
/// row["empty_map"] is set after an EmptyMap.
void attempt(nlohmann::ordered_json& row, const std::function<void()>& measure);

}  // namespace frontier_surfels::bench
