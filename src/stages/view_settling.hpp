/// Recent views - our addition to the paper: candidates that a kept view has seen are known, and settled; kernels/stages/7_recent_views.cl.
#pragma once

#include "stages/candidates.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

class ViewSettling {
 public:
  explicit ViewSettling(Commands& commands) : commands_(commands), tile_views_(commands), tile_seen_(commands) {}

  /// Clears the candidates whose centre a kept view has seen, or an earlier one by the points that are remembered of it. Those at points
  /// that were taken back stay. Clears all that it looks at if surfels must be split, because they
  /// are then found again. @param taken  TakingBack::taken()
  void settle(const Frame& frame, const Camera& camera, RecentViews& views, const SeenPoints& seen, const SeenPoints& taken,
              Candidates& candidates);

  /// [tiles of the grid][groups of VIEW_GROUP views]: a bit for each view that may know something near the candidates left in a tile. Tiles
  /// without candidates have no valid bits.
  const DeviceArray<cl_ushort>& tile_views() const { return tile_views_; }

  /// [tiles of the grid]: how many of the lattice points near the candidates left in a tile were seen before (SEEN_NONE ...);
  const DeviceArray<cl_uchar>& tile_seen() const { return tile_seen_; }

 private:
  Commands& commands_;
  DeviceArray<cl_ushort> tile_views_;
  DeviceArray<cl_uchar> tile_seen_;
};

}  // namespace frontier_surfels
