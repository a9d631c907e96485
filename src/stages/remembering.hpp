/// What views have seen that are no longer kept is remembered as seen points - ours; kernels/stages/17_remembering.cl.
#pragma once

#include "frame/recent_views.hpp"
#include "map/seen_points.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

class Remembering {
 public:
  explicit Remembering(Commands& commands);

  /// Sets the points that a view has seen. @return the blocks whose memory may have changed
  std::vector<BlockKey> remember(const ForgottenView& view, const RecentViews& views, double block_size, SeenPoints& seen);

 private:
  Commands& commands_;
  SentArray<cl_int4> blocks_, seen_by_;
  DeviceArray<cl_uchar> found_, states_;
};

}  // namespace frontier_surfels
