/// Whole frames, mapped by the code that replay_score maps with.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>

#include "bench/options.hpp"
#include "replay/run.hpp"

namespace frontier_surfels::bench {

/// Images are reduced to about this width where nothing else is said: a quarter of what a Kinect gives.
constexpr int kUsualWidth = 160;

using AfterFrame = std::function<void(const DepthFrame&, replay::FrameRecord&)>;

/// Ends with the frames, after options.row_seconds, or with Ctrl-C.
/// @throws Error  not one frame could be used
replay::Run run_frames(Mapper& mapper, replay::FrameSource& source, const Options& options, const AfterFrame& after_frame = {});

/// Adds to `row`: frames, times (all but the first frames), surfels and memory.
void add_figures(const replay::Run& run, nlohmann::ordered_json& row);

/// @param values  not empty
nlohmann::ordered_json statistics_json(const std::vector<double>& values);

/// What cannot be measured, as a device may be too small, leaves a sentence in row["error"] and the other rows undisturbed.
void attempt(nlohmann::ordered_json& row, const std::function<void()>& measure);

}  // namespace frontier_surfels::bench
