/// Taking back - ours: a surface that stands in known space makes the space behind it unknown again; kernels/stages/2_evidence.cl and
/// 3_taking_back.cl.
///
/// The world has a lattice of taken points beside that of the seen points. What kept views and seen points know at them does not count
/// until a frame sees them again. So no view has to be changed, and what a view knows beyond stays known.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "frame/recent_views.hpp"
#include "frame/working_image.hpp"
#include "frontier_surfels/config.hpp"
#include "map/map_window.hpp"
#include "map/seen_points.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

TakeBackLimits make_take_back_limits(const Config& config);

class TakingBack {
 public:
  TakingBack(Commands& commands, const Config& config, double block_size);

  /// Sends the tables of the window's blocks. The lattice becomes that of the seen points, which should not change any more once there are
  /// taken points: these would be forgotten.
  void open_window(const MapWindow& window, const SeenPoints& seen);

  /// Asks whether this frame has evidence against what is known. The others need the answer. open_window() must have been called for both
  /// lattices. Does not wait for the device.
  /// @param seen  seen points
  void look(const Camera& camera, const RecentViews& views, const SeenPoints& seen, Frame* frame);

  /// Takes space back behind the surfaces of this frame that the last frames support and that known space contradicts, and gives back what
  /// this frame sees. After that frame->has_taken says whether any point of the window is taken, and frame->takes_back whether this frame
  /// has taken some. Waits for the device.
  /// @return number of pixels whose surface took space back
  /// @throws cl::Error  the device failed: what was taken back stays so, and counts for the next frame
  std::size_t update(const Camera& camera, const MapWindow& window, const WorkingImage& image, const RecentViews& views, Frame* frame);

  /// For frames that are not likely to take space back: the same as update(), unless must_update() says later that this frame does; then
  /// nothing has changed. Does not wait for the device: frame->has_taken says whether any point of the window may be taken.
  std::size_t give_back(const Camera& camera, const MapWindow& window, const WorkingImage& image, const RecentViews& views, Frame* frame);

  /// [1], after look(): number of pixels that want to take space back. Null if space is never taken back.
  const cl::Buffer* wanting() const { return is_on_ ? &chosen_count_() : nullptr; }

  /// To be called after give_back(), once the host has waited for the device.
  bool must_update();

  /// Has one of the frames just before taken space back? Then this one is likely to.
  bool is_likely() const { return frames_since_ < LAST_FRAMES; }

  /// Ends a frame: later ones may ask whether it supports their surfaces.
  /// @param camera  has the image
  /// @param number  RecentViews::current_number()
  void add_to_last_frames(const Camera& camera, const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, std::uint64_t number);

  /// Forgets all frames and all taken points.
  void clear();

  /// The blocks of the map whose taken points may have changed since the last call; in no order, some more than once.
  std::vector<BlockKey> take_changed() { return std::exchange(changed_, {}); }

  SeenPoints& taken() { return taken_; }
  const SeenPoints& taken() const { return taken_; }
  bool has_taken() const { return is_on_ && !taken_.empty(); }

  /// @name Of the last look() that had last frames, and views or seen points to ask, [height][width] of the working image
  /// @{
  /// NO_EVIDENCE, WEAK_EVIDENCE or STRONG_EVIDENCE
  const DeviceArray<cl_uchar>& evidence() const { return evidence_; }
  /// 1: the pixel's surface took space back
  const DeviceArray<cl_uchar>& chosen() const { return chosen_; }
  /// @}

 private:
  struct LastFrame {
    Intrinsics intrinsics;
    Eigen::Isometry3d T_world_camera;
    std::size_t room = 0;  ///< of images_
    std::uint64_t number = 0;
  };
  struct Brick {
    int table, brick;
    cl_int4 place;  ///< x, y, z, counted in bricks from the window's corner, and its number
  };

  using Place = std::array<int, 3>;  ///< x, y, z, counted in bricks from the window's corner

  std::vector<Brick> bricks_with_points(const MapWindow& window) const;
  bool has_points(const MapWindow& window) const;
  std::vector<Place> places_behind(const Grid& g, const MapWindow& window, const WorkingImage& image,
                                   const std::vector<cl_uchar>& chosen) const;
  bool may_see(const WorkingImage& image, const Eigen::Vector3d& center, double radius) const;
  void find_evidence(const Frame& frame, const Camera& camera, const RecentViews& views, const SeenPoints& seen);
  std::vector<Brick> bricks_to_change(const Frame& frame, const MapWindow& window, const WorkingImage& image,
                                      const std::vector<cl_uchar>& chosen, const std::vector<Brick>& with_points);
  void change_bricks(const Frame& frame, const Camera& camera, const RecentViews& views, const MapWindow& window, bool has_chosen,
                     std::vector<Brick> bricks);
  void settle_bricks();

  Commands& commands_;
  const TakeBackLimits limits_;
  const bool is_on_;
  SeenPoints taken_;
  std::vector<BlockKey> changed_;
  std::deque<LastFrame> last_frames_;       ///< newest first, at most LAST_FRAMES
  std::size_t pixels_ = 0;                  ///< whose surface has taken space back since the last frame that did not fail
  std::size_t frames_since_ = LAST_FRAMES;  ///< frames since one took space back, at most LAST_FRAMES
  std::size_t room_size_ = 0;               ///< [pixel]
  DeviceArray<float> images_;               ///< [LAST_FRAMES][room_size_]: depths of the last frames
  SentArray<View> frame_views_, older_views_;
  cl_int older_count_ = 0;
  SentArray<cl_int4> taken_by_;
  DeviceArray<cl_uchar> coarse_, evidence_, squares_, chosen_, states_;
  DeviceArray<cl_uint> chosen_count_;
  std::shared_ptr<const std::vector<cl_uint>> chosen_count_now_;  ///< of this frame, after the next wait
  std::vector<Brick> changed_bricks_;                             ///< that settle_bricks() has to look at
  std::shared_ptr<const std::vector<cl_uchar>> states_now_;       ///< of these, after the next wait
};

}  // namespace frontier_surfels
