/// Thin gaps - our addition to the paper: frontier on a sheet of unknown that is too thin to be looked at is left out;
/// kernels/stages/7_thin_gaps.cl.
#pragma once

#include "stages/candidates.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

/// Takes those candidates off that have known space again limits.min_gap behind them, unless they are at a measured surface.
/// @param column_end  ObservedSpace::column_end()
/// @param tile_views  ViewSettling::tile_views()
void close_thin_gaps(Commands& commands, const Frame& frame, const Camera& camera, const DeviceArray<cl_int>& column_end,
                     const RecentViews& views, const DeviceArray<cl_ushort>& tile_views, const CandidateList& list, Candidates& candidates);

}  // namespace frontier_surfels
