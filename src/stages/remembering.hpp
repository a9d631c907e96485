/// What a view has seen that is not kept, or is forgotten, is remembered as seen points - ours; kernels/stages/19_remembering.cl.
#pragma once

#include <memory>
#include <vector>

#include "frame/recent_views.hpp"
#include "map/seen_points.hpp"
#include "map/view_blocks.hpp"
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

  /// @name The steps of remember_forgotten(), between which the host can do what does not concern the seen points
  /// @{
  /// Which bricks does the view see? Does not wait. After a frame that was refused, the answer to its question counts.
  void ask(const RecentViews& views, double block_size, SeenPoints& seen);
  void take_answer();  ///< waits for it, if anything was asked

  /// Lets the device set the points; does not wait. The view is dismissed: if the device fails in the middle of it, its points are lost.
  /// @return as remember()
  std::vector<BlockKey> see(RecentViews& views, SeenPoints& seen);

  /// Bricks of which all points are seen, or none, give their words back. To be called once the host has waited for the device, before
  /// anything else changes the seen points. If the frame fails before, the next ask() or remember_forgotten() does it.
  void settle(SeenPoints& seen);
  bool must_settle() const { return !seen_bricks_.empty(); }  ///< are there any of which it is not known yet?
  /// @}

  void clear();  ///< forgets the view that is being remembered, as the seen points do

 private:
  struct Brick {
    int table, number;  ///< its place in the block's table
  };
  /// A view, the blocks in which it may have seen something, and their window.
  struct Asked {
    View view;
    Window window;
    std::vector<cl_int4> blocks;  ///< x, y, z from the window's corner, and the number of the block's table
    std::size_t bricks = 0;       ///< of all blocks together
  };
  void find_bricks(const ForgottenView& view, const RecentViews& views, double block_size, SeenPoints& seen);
  std::vector<BlockKey> set_points(const RecentViews& views, SeenPoints& seen);
  void see_points(const RecentViews& views, std::vector<cl_int4> seen_by, SeenPoints& seen);
  void find_states(cl_int count, const SeenPoints& seen);
  void set_whole(SeenPoints& seen);
  void make_up(const RecentViews& views, SeenPoints& seen);

  Commands& commands_;
  Asked asked_;
  bool is_asked_ = false;  ///< the device has the answer for the forgotten view
  SentArray<cl_int4> blocks_, seen_by_;
  DeviceArray<cl_uchar> found_, states_;
  std::vector<cl_uchar> found_now_;                          ///< the answer: what the view adds to each brick
  std::vector<Brick> whole_;                                 ///< bricks of which the view sees all
  std::vector<Brick> seen_bricks_;                           ///< bricks whose points were set, until they are settled
  std::shared_ptr<const std::vector<cl_uchar>> states_now_;  ///< of these bricks, once the host has waited
};

}  // namespace frontier_surfels
