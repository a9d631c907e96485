/// Poses of a camera on a robot, for the planner that explores.
#pragma once

#include <geometry_msgs/Pose.h>

#include <Eigen/Geometry>

#include "ros/input/conversions.hpp"

namespace frontier_surfels {

using Isometry = Eigen::Isometry3f;

inline geometry_msgs::Pose to_pose(const Isometry& T) { return messages::to_pose(Eigen::Isometry3d(T.cast<double>())); }

/// The pose of a level camera at `eye` that looks at a point.
inline Isometry looking_at(const Eigen::Vector3f& eye, const Eigen::Vector3f& target) {
  const Eigen::Vector3f z = (target - eye).normalized(), x = z.cross(Eigen::Vector3f::UnitZ()).normalized();
  Isometry T = Isometry::Identity();
  T.linear() << x, z.cross(x), z;
  T.translation() = eye;
  return T;
}

/// The optical frame (z forward, x right) in the body's (x forward, z up).
inline Isometry T_body_camera() {
  return Isometry(Eigen::AngleAxisf(-M_PI / 2, Eigen::Vector3f::UnitZ()) * Eigen::AngleAxisf(-M_PI / 2, Eigen::Vector3f::UnitX()));
}

}  // namespace frontier_surfels
