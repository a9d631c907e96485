/// A furnished room of simple solids, seen by a camera that somebody carries around its table: recordings with an exact answer.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "recordings/frame_source.hpp"

namespace frontier_surfels::replay {

/// Something that can be seen. z points up.
struct Solid {
  enum class Shape { kBox, kCylinder, kSphere };  // boxes have their edges along the axes, cylinders stand upright
  Shape shape = Shape::kBox;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();     ///< [m]
  Eigen::Vector3d half_size = Eigen::Vector3d::Zero();  ///< of the bounding box [m]
  std::array<std::uint8_t, 3> rgb = {0, 0, 0};
  double tile = 0;  ///< [m] edge of a chequered pattern; 0: plain
};

/// Where a ray meets the first surface.
struct RayHit {
  double distance = 0;                               ///< in lengths of the ray's direction
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, out of the solid
  std::array<std::uint8_t, 3> rgb = {0, 0, 0};
};

/// What a depth sensor makes of the truth.
struct SensorModel {
  bool noise =
      false;  ///< as a Kinect: disparity with half a step of deviation, in whole steps (deviation 1.425e-3 z^2, steps of 2.85e-3 z^2 [m])
  double dropouts = 0;     ///< share of pixels lost in random blobs; above 0, most pixels at jump edges and grazing angles are lost as well
  std::uint64_t seed = 1;  ///< the same for the same seed and frame index, everywhere
};

/// What the hand does that holds the camera.
enum class CameraPath {
  kOrbit,  ///< goes once around the table, looking at it
  kTurn,   ///< stays where it is and turns once around: rotation only
  kWalk,   ///< walks along the furniture, through the door and into the corridor
  kClose,  ///< moves along shelf and table at 0.5 to 0.9 m
};

/// 4 x 5 x 2.5 m with a table, a chair, a shelf, a sofa, a cupboard, round things, and an open door to a corridor. Nothing is outside: a
/// ray from inside always meets something.
class Room {
 public:
  Room();

  const std::vector<Solid>& solids() const { return solids_; }

  /// The first surface that a ray from free space meets.
  std::optional<RayHit> cast(const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world) const;

  /// Exact depth along the optical axis through a point of the image [m]; +Inf where nothing is.
  double depth(const Eigen::Isometry3d& T_world_camera, const Intrinsics& intrinsics, double u, double v) const;

  /// Signed distance to the nearest surface [m]; negative in a solid. Exact in free space.
  double distance(const Eigen::Vector3d& p_world) const;

  bool inside_solid(const Eigen::Vector3d& p_world) const { return distance(p_world) < 0; }

  /// Exact view, depth CV_32FC1 [m], with colour. Frame `index` of `frames` on the way, 30 a second.
  RecordedFrame render(int index, int frames, const Intrinsics& intrinsics, CameraPath path = CameraPath::kOrbit) const;

  /// The same view as the sensor gives it: depth CV_16UC1 [mm].
  RecordedFrame render(int index, int frames, const Intrinsics& intrinsics, const SensorModel& sensor,
                       CameraPath path = CameraPath::kOrbit) const;

 private:
  std::vector<Solid> solids_;
};

/// Pose of the optical frame (x right, y down, z forward) in frame `index` of `frames` on a path, in a hand that trembles.
Eigen::Isometry3d camera_pose(CameraPath path, int index, int frames);

/// The same on the way around the table.
Eigen::Isometry3d orbit_pose(int index, int frames);

/// Kinect-like pinhole camera with fx != fy and its centre off the image's.
Intrinsics synthetic_camera(int width = 640, int height = 480);

}  // namespace frontier_surfels::replay
