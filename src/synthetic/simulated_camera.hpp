/// A depth camera that moves through a synthetic scene and takes pictures of it, for planners that choose where it goes.
#pragma once

#include <Eigen/Geometry>
#include <string>

#include "synthetic/synthetic_room.hpp"
#include "synthetic/world.hpp"

namespace frontier_surfels::replay {

/// A pinhole camera with square pixels, and the principal point in the middle. @param fov  horizontal field of view [degree]
Intrinsics camera_of_view(int width, int height, double fov);

/// Horizontal field of view of a Kinect's depth images [degree].
constexpr double kKinectView = 58;

/// Standard deviation of a Kinect's depth z over z^2 [1/m], as SensorModel::noise gives it.
constexpr double kKinectNoiseGrowth = 1.425e-3;

/// Pose of the optical frame (x right, y down, z forward) in the body frame (x forward, y left, z up): a rotation, both have one origin.
Eigen::Isometry3d T_body_optical();

struct SimulatedCameraOptions {
  Intrinsics intrinsics = camera_of_view(320, 240, kKinectView);
  SensorModel sensor;   ///< errors; with none of depth, images are exact, CV_32FC1 [m]; else CV_16UC1 [mm]
  double radius = 0.2;  ///< [m] of a ball around the camera that nothing may be in
  int threads = 1;      ///< that render; 0: as many as the machine has
};

/// What became of a move.
struct Move {
  bool reached = false;
  double metres = 0;    ///< that the camera has moved
  std::string message;  ///< a sentence: where it is, and why it stopped if it did not reach its goal
};

/// Knows no time: it is at its goal at once.
class SimulatedCamera {
 public:
  /// @param world        must outlive this
  /// @param T_world_body  where it starts
  /// @throws Error if an option or the start cannot be used
  SimulatedCamera(const World& world, const Eigen::Isometry3d& T_world_body, const SimulatedCameraOptions& options = {});

  /// Moves the body on the straight line to a pose. If a solid would come closer than the radius, it stops there. In either case it turns
  /// as commanded. @throws Error if the pose is no pose; it then stays where it is
  Move move_to(const Eigen::Isometry3d& T_world_body);

  /// Goes back to the start, as if it had neither moved nor taken a picture.
  void restart();

  /// Takes a picture. The result is valid until the next one. Its index counts pictures; its stamp is 1 / 30 s after the last one's.
  const SensedFrame& image();

  const Eigen::Isometry3d& T_world_body() const { return T_world_body_; }
  Eigen::Isometry3d T_world_camera() const { return T_world_body_ * T_body_optical(); }  ///< of the optical frame
  const SimulatedCameraOptions& options() const { return options_; }
  double metres() const { return metres_; }  ///< of all moves
  int images() const { return images_; }     ///< pictures taken

 private:
  const World& world_;
  SimulatedCameraOptions options_;
  Eigen::Isometry3d T_world_start_, T_world_body_;  ///< of the body
  double metres_ = 0;
  int images_ = 0;
  SensedFrame image_;
};

}  // namespace frontier_surfels::replay
