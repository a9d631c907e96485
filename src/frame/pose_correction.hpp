/// Pose correction, ours: recorded poses jitter by some millimetres and tenths of a degree from frame to frame, and known space is the
/// union of what all frames claim to have seen: the worst poses decide. So a frame is aligned with the last frames of its camera
/// (pose_alignment.hpp), and then moved back towards the recorded pose by a share, which depends on the deviations of the recorded poses
/// from the aligned ones. Jitter is new in each frame: the share is small, and the mean of the last recorded poses counts. Slow errors, of
/// the poses or of the sensor, are alike in successive frames: then the share is 1, and poses stay as they were recorded, because nobody
/// knows which of the two is wrong. So the map stays where the recorded poses are.
#pragma once

#include <Eigen/Geometry>
#include <deque>
#include <optional>

#include "frame/camera_list.hpp"
#include "frame/pose_alignment.hpp"
#include "frame/working_image.hpp"
#include "frontier_surfels/config.hpp"

namespace frontier_surfels {

/// What the deviations of a camera's recorded poses from the aligned ones are like.
struct Deviations {
  /// Of the shifts, or of the turns, along or about an axis: running means.
  struct Share {
    double variance;        ///< [m^2] or [rad^2]
    double covariance = 0;  ///< of two frames in succession
    double value = 1;       ///< by which the last frame was moved back to the recorded pose
  };
  Share shift = {kShiftError * kShiftError}, turn = {kTurnError * kTurnError};
  std::optional<Motion> last;  ///< of the last frame, from the aligned pose to the recorded one; none if it could not be aligned
};

/// The pose with which a frame is mapped.
struct CorrectedPose {
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  Deviations deviations;  ///< with this frame's
};

class PoseCorrection {
 public:
  explicit PoseCorrection(const Config& config) : config_(config) {}

  /// The pose for a frame. Changes nothing: the same frame can be tried again.
  /// @param T_world_camera  the recorded pose
  CorrectedPose correct(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera) const;

  /// The part of add() that does not depend on whether the frame is mapped.
  void prepare(const WorkingImage& image);

  /// Remembers a frame that has been mapped, the one that was prepared last.
  void add(const WorkingImage& image, const CorrectedPose& pose);

  void clear() { histories_.clear(); }

 private:
  /// The last frames of a camera.
  class History {
   public:
    explicit History(const Intrinsics& intrinsics) : intrinsics_(intrinsics) {}
    const Intrinsics& intrinsics() const { return intrinsics_; }
    std::vector<const ReferenceFrame*> references(const Eigen::Isometry3d& T_world_camera) const;

    std::deque<ReferenceFrame> last;  ///< newest first
    std::size_t frames = 0;           ///< so far
    Deviations deviations;

   private:
    Intrinsics intrinsics_;
  };

  Config config_;
  CameraList<History> histories_;
  std::vector<float> prepared_;  ///< inverse depths of the frame that was prepared last
};

}  // namespace frontier_surfels
