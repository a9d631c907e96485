/// Alignment of a frame with earlier ones: the pose at which its surfaces lie where theirs do.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "frame/working_image.hpp"
#include "frontier_surfels/config.hpp"

namespace frontier_surfels {

/// A frame to which others are aligned.
struct ReferenceFrame {
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  std::vector<float> inverse_depth;  ///< [height][width] [1/m]; 0: no surface
};

/// The inverse depths of an image, in the format of ReferenceFrame.
/// @param room  no longer needed, so that its memory can be used: new memory of the size of an image costs more than its contents
std::vector<float> inverse_depths(const WorkingImage& image, std::vector<float> room = {});

/// A small motion in the world: a shift [m], and a turn about a centre. The turn is 2 tan(angle / 2) times its axis, which for small
/// angles is the rotation vector [rad].
struct Motion {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
};

/// T after the motion.
Eigen::Isometry3d moved(const Eigen::Isometry3d& T, const Motion& motion, const Eigen::Vector3d& centre);

/// The motion that leads from one pose to another: moved(from, motion_between(from, to, centre), centre) is `to`.
Motion motion_between(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, const Eigen::Vector3d& centre);

/// Expected errors of a recorded pose, by which it is held where surfaces do not say where it is.
constexpr double kShiftError = 0.003;            ///< [m] along each axis
constexpr double kTurnError = 0.2 * M_PI / 180;  ///< [rad] about each axis

/// Aligns a frame: iterated least squares of the distances between its points and the surfaces of the references, along the points'
/// normals, and of the distance from the recorded pose.
/// @param image           points are taken at about 800 of its pixels, whatever its size
/// @param T_world_camera  the recorded pose
/// @param references      images of the same camera
/// @param number          of the frame: in each, other pixels are taken
/// @param config          the sensor's noise
/// @return none if too few points lie on surfaces of the references
std::optional<Eigen::Isometry3d> align(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera,
                                       const std::vector<const ReferenceFrame*>& references, std::size_t number, const Config& config);

}  // namespace frontier_surfels
