/// Thin gaps - our addition to the paper: no frontier is made on a sheet of unknown space that is too thin to hold anything;
/// kernels/stages/9_thin_gaps.cl.
#pragma once

#include "stages/candidates.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

/// Clears the candidates that have known space again limits.min_gap behind them, unless they are at a measured surface.
/// @param column_end  ObservedSpace::column_end()
/// @param tile_views  ViewSettling::tile_views()
/// @param taken       TakingBack::taken()
void close_thin_gaps(Commands& commands, const Frame& frame, const Camera& camera, const DeviceArray<cl_int>& column_end,
                     const RecentViews& views, const DeviceArray<cl_ushort>& tile_views, const SeenPoints& taken, const CandidateList& list,
                     Candidates& candidates);

}  // namespace frontier_surfels
