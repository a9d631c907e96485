/// The paths of the camera through the synthetic room.
#include <algorithm>
#include <array>
#include <cmath>

#include "synthetic/synthetic_room.hpp"

namespace frontier_surfels::replay {
namespace {

using Eigen::Vector3d;

/// Position and direction of the camera: yaw from x towards y, pitch downwards, roll [rad].
struct Aim {
  Vector3d p_world;
  double yaw = 0, pitch = 0, roll = 0;
};

Aim orbit(double angle) {
  const auto sway = [&](double cycles, double phase) { return std::sin(cycles * angle + phase); };
  Aim aim;
  aim.p_world = {1.2 * std::cos(angle), 1.5 * std::sin(angle), 1.35 + 0.12 * sway(4, 0.4)};
  aim.yaw = std::atan2(-aim.p_world.y(), -aim.p_world.x()) + 0.45 * sway(3, 0.9);
  aim.pitch = 0.35 + 0.15 * sway(5, 0);
  aim.roll = 0.04 * sway(2, 0.3);
  return aim;
}

/// Six turns, down to the floor and up to the ceiling twice, on one way around the table.
Aim explore(double angle) {
  Aim aim;
  aim.p_world = {1.2 * std::cos(angle), 1.5 * std::sin(angle), 1.4};
  aim.yaw = M_PI + 6 * angle;
  aim.pitch = 0.25 + 0.7 * std::sin(2 * angle);
  return aim;
}

Aim turn(double angle) { return {{1.0, 1.2, 1.4}, angle, 0.25 + 0.2 * std::sin(2 * angle), 0}; }

/// A point of a path. The camera moves on a straight line from each to the next.
struct Station {
  double x, y, z, yaw, pitch;
};

template <std::size_t N>
Aim between(const std::array<Station, N>& stations, double share) {
  const double at = std::clamp(share, 0.0, 1.0) * (N - 1);
  const std::size_t from = std::min<std::size_t>(static_cast<std::size_t>(at), N - 2);
  const Station &a = stations[from], &b = stations[from + 1];
  const double t = at - from, smooth = t * t * (3 - 2 * t);
  const auto mix = [&](double Station::*member) { return a.*member + smooth * (b.*member - a.*member); };
  return {{mix(&Station::x), mix(&Station::y), mix(&Station::z)}, mix(&Station::yaw), mix(&Station::pitch), 0};
}

Aim walk(double share) {
  static constexpr std::array<Station, 8> kStations = {{{1.3, -1.0, 1.5, 3.0, 0.3},
                                                        {-0.3, -1.2, 1.5, 3.6, 0.4},
                                                        {-1.1, 0.6, 1.5, 1.6, 0.2},
                                                        {-0.4, 1.7, 1.5, 0.3, 0.25},
                                                        {0.95, 1.9, 1.5, 1.57, 0.1},
                                                        {0.95, 2.9, 1.5, 1.9, 0.1},
                                                        {0.9, 3.3, 1.5, 3.1, 0.2},
                                                        {0.8, 3.3, 1.5, 5.9, 0.2}}};
  return between(kStations, share);
}

Aim close_up(double share) {
  static constexpr std::array<Station, 6> kStations = {{{-1.0, -1.0, 0.9, 3.14, 0.1},
                                                        {-1.0, -0.2, 1.3, 3.14, 0.2},
                                                        {-0.95, -0.3, 1.25, 4.7, 0.6},
                                                        {-0.4, -0.85, 1.2, 7.6, 0.6},
                                                        {0.4, -0.85, 1.25, 8.0, 0.6},
                                                        {1.2, -0.1, 1.2, 9.4, 0.5}}};
  return between(kStations, share);
}

/// Three times from one end of the arc to the other, looking at the corner of the table where the box of some scenes stands.
Aim arc(double share) {
  const double angle = -M_PI / 4 - 75 * M_PI / 180 * std::cos(3 * M_PI * share);
  Aim aim;
  aim.p_world = {0.45 + 1.2 * std::cos(angle), -0.28 + 1.2 * std::sin(angle), 1.5 + 0.08 * std::sin(20 * share)};
  aim.yaw = angle + M_PI + 0.1 * std::sin(25 * share);
  aim.pitch = 0.45 + 0.08 * std::sin(30 * share);
  return aim;
}

Aim watch(double share) {
  Aim aim;
  aim.p_world = {-0.4 + 0.1 * std::sin(14 * share), 0.9 + 0.3 * std::sin(4 * M_PI * share), 1.5};
  aim.yaw = 0.08 + 0.3 * std::sin(8 * M_PI * share);
  aim.pitch = 0.25;
  return aim;
}

Aim aim_of(CameraPath path, int index, int frames) {
  const double share = static_cast<double>(index) / std::max(1, frames), angle = 2 * M_PI * share;
  switch (path) {
    case CameraPath::kExplore:
      return explore(angle);
    case CameraPath::kTurn:
      return turn(angle);
    case CameraPath::kWalk:
      return walk(share);
    case CameraPath::kClose:
      return close_up(share);
    case CameraPath::kArc:
      return arc(share);
    case CameraPath::kWatch:
      return watch(share);
    default:
      return orbit(angle);
  }
}

}  // namespace

Eigen::Isometry3d camera_pose(CameraPath path, int index, int frames) {
  const auto tremble = [&](double rate) { return std::sin(rate * index) + std::sin(1.7 * rate * index + 1); };
  const Aim aim = aim_of(path, index, frames);
  // The path that only turns trembles in its angles alone.
  const double shift = path == CameraPath::kTurn ? 0 : 0.006;
  const Vector3d p_world = aim.p_world + shift * Vector3d(tremble(0.9), tremble(1.1), tremble(1.3));
  const Eigen::Quaterniond forward_to_optical(-0.5, 0.5, -0.5, 0.5);  // x forward, z up -> z forward, y down
  const Eigen::Quaterniond rotation = Eigen::AngleAxisd(aim.yaw + 0.008 * tremble(0.7), Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(aim.pitch + 0.008 * tremble(0.8), Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(aim.roll + 0.008 * tremble(1.2), Vector3d::UnitX()) * forward_to_optical;
  return Eigen::Translation3d(p_world) * rotation.normalized();
}

}  // namespace frontier_surfels::replay
