/// What a view has seen that is not kept, or is forgotten, is remembered as seen points - ours; kernels/stages/19_remembering.cl.
#pragma once

#include "frame/recent_views.hpp"
#include "map/seen_points.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

class Remembering {
 public:
  explicit Remembering(Commands& commands);

  /// Sets the points that a view has seen. @return the blocks whose memory may have changed
  /// @throws cl::Error  the device failed: only a part of the points is set, and remember() is to be called again
  std::vector<BlockKey> remember(const ForgottenView& view, const RecentViews& views, double block_size, SeenPoints& seen);

  /// Remembers the view that the last frame has forgotten, if there is one that has not been remembered yet. @return as remember()
  std::vector<BlockKey> remember_forgotten(RecentViews& views, double block_size, SeenPoints& seen);

 private:
  std::vector<cl_uchar> find_bricks(const Window& window, const View& view, const RecentViews& views, const std::vector<cl_int4>& blocks,
                                    SeenPoints& seen);
  std::vector<cl_uchar> see_points(const Window& window, const View& view, const RecentViews& views, std::vector<cl_int4> asked,
                                   SeenPoints& seen);

  Commands& commands_;
  SentArray<cl_int4> blocks_, seen_by_;
  DeviceArray<cl_uchar> found_, states_;
};

}  // namespace frontier_surfels
