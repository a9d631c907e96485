/// Turns exact depth into what a sensor would measure.
#pragma once

#include <opencv2/core.hpp>

#include "synthetic/synthetic_room.hpp"

namespace frontier_surfels::replay {

/// @param depth          CV_32FC1 [m]; 0: no surface
/// @param cos_incidence  CV_32FC1, cosine of the angle between ray and surface normal
/// @param index          index of the frame: each has its own random numbers
/// @return               CV_16UC1 [mm]; 0: no measurement
cv::Mat measure(const cv::Mat& depth, const cv::Mat& cos_incidence, const SensorModel& sensor, int index);

/// The pose that a tracker with errors would give.
Eigen::Isometry3d tracked(const Eigen::Isometry3d& T_world_camera, const SensorModel& sensor, int index);

/// A recorded frame as an ideal sensor would have seen it, and with errors on top of those that it has. Depth of 16 bits is in mm.
/// @param index  place in the new recording
SensedFrame spoilt(const RecordedFrame& frame, const SensorModel& sensor, int index);

}  // namespace frontier_surfels::replay
