/// A furnished room made of simple solids, and views of it: recordings for which the exact answer is known.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "recordings/frame_source.hpp"
#include "synthetic/synthetic_scenes.hpp"
#include "synthetic/world.hpp"

namespace frontier_surfels::replay {

/// The errors of a depth sensor, and of its poses.
struct SensorModel {
  bool noise = false;   ///< as of a Kinect: disparity has a deviation of half a step and is rounded to whole steps; in depth, a deviation
                        ///< of 1.425e-3 z^2 and steps of 2.85e-3 z^2 [m]
  double dropouts = 0;  ///< share of pixels lost in random blobs; above 0, most pixels at jump edges and grazing angles are lost as well
  double outliers = 0;  ///< share of pixels whose depth is random, evenly from 0.5 to 3 m
  bool flying = false;  ///< the pixels on both sides of a jump of depth lie anywhere between foreground and background
  double position_noise = 0;  ///< standard deviation of each coordinate of the recorded position [m], new in each frame
  double rotation_noise = 0;  ///< the same of the recorded rotation about each axis of the camera [rad]
  std::uint64_t seed = 1;     ///< errors are the same for the same seed and frame index on every machine
};

/// Path of the camera.
enum class CameraPath {
  kOrbit,    ///< goes once around the table, looking at it
  kExplore,  ///< goes once around the table and looks everywhere: little of the room stays unseen
  kTurn,     ///< stays where it is and turns once around: rotation only
  kWalk,     ///< walks along the furniture, through the door and into the corridor
  kClose,    ///< moves along shelf and table at 0.5 to 0.9 m
  kArc,      ///< three times along an arc of 150 degrees around a corner of the table
  kWatch,    ///< looks to and fro between the door and the table, nearly from one place
};

/// What an ideal sensor sees, and what one with errors measures.
struct SensedFrame {
  RecordedFrame ideal;     ///< depth as CV_32FC1 [m]
  RecordedFrame measured;  ///< depth as CV_16UC1 [mm], and the recorded pose
};

/// 4 x 5 x 2.5 m with a table, a chair, a shelf, a sofa, a cupboard, round things, and an open door to a corridor. A ray
/// from inside always meets a surface.
class Room : public World {
 public:
  /// @param frames  number of frames of the whole recording, which says when things come and go
  explicit Room(Scene scene = Scene::kRoom, int frames = 0);

  /// The things that come and go. Only the images below show them, not what the World says.
  const std::vector<SceneThing>& things() const { return things_; }

  /// The exact view of frame `index` of `frames` along a path, with depth as CV_32FC1 [m] and with colour. There are 30 frames a second.
  RecordedFrame render(int index, int frames, const Intrinsics& intrinsics, CameraPath path = CameraPath::kOrbit) const;

  /// The same view as a sensor with errors gives it, with depth as CV_16UC1 [mm].
  RecordedFrame render(int index, int frames, const Intrinsics& intrinsics, const SensorModel& sensor,
                       CameraPath path = CameraPath::kOrbit) const;

  /// Both.
  SensedFrame sense(int index, int frames, const Intrinsics& intrinsics, const SensorModel& sensor, CameraPath path) const;

 private:
  std::vector<SceneThing> things_;
};

/// Pose of the optical frame (x right, y down, z forward) in frame `index` of `frames` along a path, with a little tremor.
Eigen::Isometry3d camera_pose(CameraPath path, int index, int frames);

/// camera_pose() of the path around the table.
Eigen::Isometry3d orbit_pose(int index, int frames);

/// A pinhole camera like a Kinect's. To reveal mistakes, fx and fy differ, and the principal point is off the image's centre.
Intrinsics synthetic_camera(int width = 640, int height = 480);

}  // namespace frontier_surfels::replay
