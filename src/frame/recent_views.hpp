/// The recent views, our addition to the paper: their kept depth images tell exactly what the last views have seen.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/shared.h"
#include "frame/working_image.hpp"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

/// T in the kernels' format.
Transform to_transform(const Eigen::Isometry3d& T);

/// Step of the kept depths [m]; they are stored as whole numbers of steps. At most z_max / 32768, and a power of two, so that the
/// conversion back is exact.
double depth_step_for(double z_max);

/// A view whose image will soon be replaced by another one.
struct ForgottenView {
  Intrinsics intrinsics;
  Eigen::Isometry3d T_world_camera;
  std::size_t room = 0;  ///< of its image
  double deepest = 0;    ///< largest depth of its image [m]
};

class RecentViews {
 public:
  RecentViews(Commands& commands, const Config& config);

  /// Makes a frame's view the current one and sends its depths to the device. Images may differ in size.
  /// @throws BadFrame  the image is too large for the number of kept views
  void set_current(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera);

  /// Makes room for saved views, so that set_current() does not need to.
  /// @throws FileError  they are too large for the number of kept views. @throws DeviceError, cl::Error  the device has no memory for them
  void make_room(const std::vector<SavedView>& views);

  View own_view() const;  ///< the current view, seen from its own camera
  /// The current view, seen from the frame `local`.
  View own_view_from(const Eigen::Isometry3d& T_camera_local) const { return to_view(current_, T_camera_local); }

  /// Any view as this frame's camera sees it, without an image.
  View view_from_current(const Intrinsics& intrinsics, const Eigen::Isometry3d& T_world_camera) const;

  std::uint64_t current_number() const { return current_.number; }  ///< see numbers()

  /// The kept views that came before the one with this number, newest first.
  std::vector<View> views_before(std::uint64_t number) const;

  /// Sends the kept views to the device, each with its pose relative to the current camera, or to another frame. @return their number
  int prepare() { return prepare(current_.T_world_camera); }
  /// @param after  number of a view: only those that came later are sent
  int prepare(const Eigen::Isometry3d& T_world_frame, std::uint64_t after = 0);

  /// Keeps the current view if its camera or pose differs enough from every kept view. @return whether it was kept
  bool keep_current();

  /// Keeps the current view in any case.
  void keep();

  /// Numbers of the kept views, oldest first: the how-many-th set_current() each came with. They are never used again.
  std::vector<std::uint64_t> numbers() const;
  SavedView saved(std::uint64_t number) const;                            ///< a kept view
  std::vector<std::pair<Intrinsics, Eigen::Isometry3d>> cameras() const;  ///< of the kept views, and their poses, oldest first

  /// The view whose content is lost after keep_current(): the oldest kept one, or the current one if it was not kept. Its image stays on
  /// the device until the next set_current(). None if it has no depth, if a kept view was not replaced, after dismiss_forgotten(), or
  /// without config.seen_points.
  const std::optional<ForgottenView>& forgotten() const { return forgotten_; }
  void dismiss_forgotten() { forgotten_.reset(); }                                         ///< it is remembered elsewhere
  View view_of(const ForgottenView& view, const Eigen::Isometry3d& T_camera_local) const;  ///< as seen from the frame `local`

  /// Are all views that were kept since the map was empty still kept? Then the kept views alone know all known space.
  bool complete() const { return complete_; }

  /// Forgets all views. @param map_is_empty  whether the map is empty, too, so that complete() becomes true
  void clear(bool map_is_empty);

  const cl::Buffer& views() const { return views_(); }
  const cl::Buffer& depths() const { return depths_(); }
  /// The views sent by prepare(), field by field in groups: [view_groups()][VIEW_LANE_FIELDS][VIEW_GROUP], filled up with zeros.
  const cl::Buffer& view_lanes() const { return view_lanes_(); }
  std::size_t view_groups() const { return (kept_.size() + VIEW_GROUP - 1) / VIEW_GROUP; }
  std::size_t count() const { return kept_.size(); }

 private:
  struct Kept {
    Intrinsics intrinsics;
    Eigen::Isometry3d T_world_camera;
    std::size_t room = 0;  ///< row of depths_
    double deepest = 0;    ///< largest depth [m]
    std::uint64_t number = 0;
  };
  View to_view(const Kept& kept, const Eigen::Isometry3d& T_view_camera) const;
  bool differs_enough() const;
  void forget(const Kept& view);
  std::string excess(std::size_t size) const;
  void enlarge_rooms(std::size_t size);
  std::size_t free_room() const;

  Config config_;
  double depth_step_;          ///< [m]
  std::size_t room_size_ = 0;  ///< elements that the largest image so far takes
  std::uint64_t last_number_ = 0;
  Kept current_;
  std::optional<ForgottenView> forgotten_;
  std::deque<Kept> kept_;  ///< newest first
  bool complete_;
  SentArray<View> views_;
  SentArray<float> view_lanes_;
  /// [recent_views + 1][room_size_], in steps of depth_step_: images of the kept views and of the current one. Behind each image follows
  /// the largest depth of each block of VIEW_BLOCK x VIEW_BLOCK pixels, and then the smallest one, which is 0 if a pixel has none.
  DeviceArray<cl_ushort> depths_;
};

}  // namespace frontier_surfels
