/// The ring of recent views - our addition to the paper: exact knowledge of what the last views have seen.
#pragma once

#include <Eigen/Geometry>
#include <deque>
#include <vector>

#include "common/shared.h"
#include "frame/working_image.hpp"
#include "frontier_surfels/config.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

/// T as the kernels take it.
Transform to_transform(const Eigen::Isometry3d& T);

/// Depths of views are kept as whole numbers of such steps [m]: a power of two, so that they are exact numbers again; at most z_max /
/// 32768.
double depth_step_for(double z_max);

class RecentViews {
 public:
  RecentViews(Commands& commands, const Config& config);

  /// Sends this frame's depths to the device; they are own_view()'s until the next call. Images may be of different sizes.
  /// @throws BadFrame  the image is too large for as many views as are kept
  void set_current(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera);
  View own_view() const;  ///< this frame's, as its own camera sees it

  /// Sends the kept views, each with its pose relative to the current camera. @return how many there are
  int prepare();

  /// Keeps the current view if it adds something. @return whether it did
  bool keep_current();

  /// Have all views ever kept since the map was empty been kept until now? Then they alone know what is known.
  bool complete() const { return complete_; }

  /// Forgets all views. @param map_is_empty  whether there is nothing that only they knew
  void clear(bool map_is_empty);

  const cl::Buffer& views() const { return views_(); }
  const cl::Buffer& depths() const { return depths_(); }
  /// The views that prepare() has sent once more, by fields: [view_groups()][VIEW_LANE_FIELDS][VIEW_GROUP], zeros behind the last.
  const cl::Buffer& view_lanes() const { return view_lanes_(); }
  std::size_t view_groups() const { return (kept_.size() + VIEW_GROUP - 1) / VIEW_GROUP; }
  std::size_t count() const { return kept_.size(); }

 private:
  struct Kept {
    Intrinsics intrinsics;
    Eigen::Isometry3d T_world_camera;
    std::size_t room = 0;  ///< in the pool
  };
  View to_view(const Kept& kept, const Eigen::Isometry3d& T_view_camera) const;
  bool adds_something() const;
  void enlarge_rooms(std::size_t size);
  std::size_t free_room() const;

  Config config_;
  double depth_step_;          ///< [m]
  std::size_t room_size_ = 0;  ///< what the largest image so far takes
  Kept current_;
  std::deque<Kept> kept_;  ///< newest first
  bool complete_;
  SentArray<View> views_;
  SentArray<float> view_lanes_;
  /// [recent_views + 1][room_size_]: the kept views' images and the current one's, in steps of depth_step_; behind each the largest depth
  /// in each block of VIEW_BLOCK x VIEW_BLOCK pixels: beyond it a view knows nothing there.
  DeviceArray<cl_ushort> depths_;
};

}  // namespace frontier_surfels
