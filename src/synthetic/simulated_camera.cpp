#include "synthetic/simulated_camera.hpp"

#include <cmath>
#include <cstdio>

#include "config/config_text.hpp"
#include "synthetic/synthetic_sensor.hpp"

namespace frontier_surfels::replay {
namespace {

using Eigen::Isometry3d;

constexpr double kFrameRate = 30;    // [Hz]
constexpr double kFirstStamp = 1;    // [s]; ROS has no time 0
constexpr double kRotation = 1e-6;   // how far a rotation matrix may be from being one
constexpr int kLargestImage = 4096;  // [pixel]

std::string in_centimetres(double metres) {
  char text[32];
  std::snprintf(text, sizeof text, "%ld.%02ld", std::lround(metres * 100) / 100, std::lround(metres * 100) % 100);
  return text;
}

void check_pose(const Isometry3d& pose, const char* name) {
  const bool is_pose = pose.matrix().allFinite() &&
                       (pose.linear().transpose() * pose.linear() - Eigen::Matrix3d::Identity()).norm() < kRotation &&
                       pose.linear().determinant() > 0;
  if (!is_pose) throw Error(std::string(name) + " is no pose: its numbers must be finite, and its rotation be one.");
}

void check(const SimulatedCameraOptions& options) {
  const Intrinsics& camera = options.intrinsics;
  const bool fits = camera.width >= 8 && camera.height >= 8 && camera.width <= kLargestImage && camera.height <= kLargestImage &&
                    camera.fx > 0 && camera.fy > 0 && std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy);
  if (!fits) throw Error("The intrinsics of the simulated camera must be of 8 to 4096 pixels each way, with fx and fy above 0.");
  if (!(options.radius >= 0 && options.radius <= 10))
    throw Error("radius of the simulated camera is " + to_text(options.radius) + ": it must be from 0 to 10 m.");
}

bool has_depth_errors(const SensorModel& sensor) { return sensor.noise || sensor.dropouts > 0 || sensor.outliers > 0 || sensor.flying; }

}  // namespace

Intrinsics camera_of_view(int width, int height, double fov) {
  const double focal = width / 2.0 / std::tan(fov * M_PI / 360);
  return {focal, focal, (width - 1) / 2.0, (height - 1) / 2.0, width, height};
}

Isometry3d T_body_optical() {
  Isometry3d T = Isometry3d::Identity();
  T.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return T;
}

SimulatedCamera::SimulatedCamera(const World& world, const Isometry3d& T_world_body, const SimulatedCameraOptions& options)
    : world_(world), options_(options), T_world_start_(T_world_body), T_world_body_(T_world_body) {
  check(options);
  check_pose(T_world_body, "The start of the simulated camera");
  if (!(world.distance(T_world_body.translation()) >= options.radius)) {
    const Eigen::Vector3d& p = T_world_body.translation();
    throw Error("The simulated camera cannot start at " + to_text(p.x()) + ", " + to_text(p.y()) + ", " + to_text(p.z()) +
                " m: a solid is less than the radius of " + to_text(options.radius) + " m away.");
  }
}

Move SimulatedCamera::move_to(const Isometry3d& T_world_body) {
  check_pose(T_world_body, "The goal of the simulated camera");
  const Eigen::Vector3d from = T_world_body_.translation(), way = T_world_body.translation() - from;
  const double wanted = way.norm(), free = world_.free_length(from, T_world_body.translation(), options_.radius);
  Move move;
  move.reached = free >= wanted;
  move.metres = free;
  T_world_body_ = T_world_body;
  if (!move.reached) T_world_body_.translation() = from + free / wanted * way;
  metres_ += free;
  move.message = move.reached ? "The camera has reached its goal, " + in_centimetres(free) + " m away."
                              : "The camera has stopped after " + in_centimetres(free) + " of " + in_centimetres(wanted) +
                                    " m: a solid would come closer than " + to_text(options_.radius) + " m.";
  return move;
}

void SimulatedCamera::restart() {
  T_world_body_ = T_world_start_;
  metres_ = 0;
  images_ = 0;
}

const SensedFrame& SimulatedCamera::image() {
  const View view = world_.render(T_world_camera(), options_.intrinsics, options_.threads);
  const double stamp = kFirstStamp + images_ / kFrameRate;
  image_.ideal = {static_cast<std::size_t>(images_), stamp, view.depth, view.color, options_.intrinsics, T_world_camera()};
  image_.measured = image_.ideal;
  if (has_depth_errors(options_.sensor)) image_.measured.depth = measure(view.depth, view.cos_incidence, options_.sensor, images_);
  image_.measured.T_world_camera = tracked(T_world_camera(), options_.sensor, images_);
  ++images_;
  return image_;
}

}  // namespace frontier_surfels::replay
