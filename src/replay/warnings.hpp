/// What is wrong with a recording whose frames add little or nothing to the map.
#pragma once

#include <string>
#include <vector>

#include "replay/run.hpp"

namespace frontier_surfels::replay {

/// A sentence for each fault that the frames of a run have in common. It names the likely cause, and what to do.
std::vector<std::string> warnings(const Run& run);

/// Whether a camera stays where it is in all of several frames.
bool is_still(const std::vector<FrameRecord>& frames);

/// Why a frame adds nothing to the map, in a word: DepthCensus::reason(), or still_camera in a run whose camera never moves; empty if it
/// does.
std::string reason(const FrameRecord& frame, bool still);

}  // namespace frontier_surfels::replay
