#include "synthetic/synthetic_room.hpp"

#include <algorithm>
#include <cmath>

#include "synthetic/synthetic_sensor.hpp"

namespace frontier_surfels::replay {
namespace {

using Eigen::Vector3d;

constexpr double kFrameRate = 30;  // [Hz]
constexpr double kFirstStamp = 1;  // [s]; ROS has no time 0

/// The room itself, -2 < x < 2, -2.5 < y < 2.5, and a corridor behind its door, y > 2.6. Walls are 10 cm thick.
Solids shell() {
  const Rgb floor = {150, 111, 72}, plaster = {222, 216, 200}, blue = {140, 165, 190}, corridor = {196, 190, 160};
  return {box({-2.1, -2.6, -0.1}, {2.1, 4.0, 0}, floor, 0.25),
          box({-2.1, -2.6, 2.5}, {2.1, 4.0, 2.6}, {240, 240, 240}),
          box({-2.1, -2.6, 0}, {-2, 2.6, 2.5}, plaster),
          box({2, -2.6, 0}, {2.1, 4.0, 2.5}, plaster),
          box({-2, -2.6, 0}, {2, -2.5, 2.5}, blue),
          box({-2, 2.5, 0}, {0.5, 2.6, 2.5}, blue),
          box({1.4, 2.5, 0}, {2, 2.6, 2.5}, blue),
          box({0.5, 2.5, 2.05}, {1.4, 2.6, 2.5}, blue),
          box({-0.6, 3.9, 0}, {2, 4.0, 2.5}, corridor),
          box({-0.6, 2.6, 0}, {-0.5, 3.9, 2.5}, corridor),
          box({1.97, 0.2, 1.2}, {2, 1.0, 1.8}, {200, 60, 50}, 0.1)};  // a picture
}

Solids table_and_chair() {
  const Rgb wood = {176, 120, 66}, red = {170, 50, 45};
  const Vector3d top_low(-0.55, -0.5, 0.71), top_high(0.75, 0.3, 0.74), seat_low(-0.12, 0.5, 0.43), seat_high(0.32, 0.94, 0.47);
  Solids solids = {box(top_low, top_high, wood),
                   sphere({0.45, 0.05, 0.86}, 0.12, {230, 120, 30}),
                   cylinder({-0.25, -0.2, 0.74}, 0.06, 0.26, {40, 110, 160}),
                   box({-0.05, 0.0, 0.74}, {0.2, 0.18, 0.82}, {70, 130, 70}),
                   box(seat_low, seat_high, red),
                   box({-0.12, 0.9, 0.47}, {0.32, 0.94, 0.92}, red)};
  append(solids, legs(top_low, top_high, 0.06, wood));
  append(solids, legs(seat_low, seat_high, 0.04, {60, 60, 60}));
  return solids;
}

Solids shelf() {
  const Rgb wood = {110, 80, 55};
  Solids solids = {box({-2, -1.2, 0}, {-1.7, -1.17, 1.8}, wood),  // sides and boards; the wall is the back
                   box({-2, -0.03, 0}, {-1.7, 0, 1.8}, wood),
                   box({-1.95, -1.1, 0.62}, {-1.75, -0.8, 0.86}, {60, 90, 150}),
                   box({-1.95, -0.6, 1.22}, {-1.75, -0.2, 1.5}, {150, 140, 60}),
                   cylinder({-1.85, -0.95, 1.22}, 0.08, 0.2, {120, 60, 120}),
                   sphere({-1.85, -0.35, 0.71}, 0.09, {200, 200, 60})};
  for (const double z : {0.0, 0.59, 1.19, 1.77}) solids.push_back(box({-2, -1.17, z}, {-1.7, -0.03, z + 0.03}, wood));
  return solids;
}

Solids along_the_walls() {
  const Rgb green = {70, 110, 85}, white = {225, 225, 215};
  return {box({-1.5, -2.5, 0}, {-0.1, -1.8, 0.42}, green),                                                    // a sofa
          box({-1.5, -2.5, 0.42}, {-0.1, -2.25, 0.82}, green),  box({1.45, -2.5, 0}, {2, -1.5, 0.9}, white),  // a cupboard with a lamp
          cylinder({1.72, -2.0, 0.9}, 0.03, 0.3, {50, 50, 50}), sphere({1.72, -2.0, 1.3}, 0.13, {250, 240, 190}),
          cylinder({-1.6, 2.1, 0}, 0.16, 0.4, {90, 90, 100})};  // a bin
}

/// A box of a thing, at some time.
struct PlacedSolid {
  Solid solid;  ///< in its own frame, in which it is centred
  Eigen::Isometry3d T_world_solid;
};

std::vector<PlacedSolid> placed_at(const std::vector<SceneThing>& things, int index) {
  std::vector<PlacedSolid> placed;
  for (const SceneThing& thing : things) {
    const scoring::Stand* stand = thing.object.stand_at(static_cast<std::size_t>(index));
    if (stand == nullptr) continue;
    const auto boxes = thing.object.placed(*stand);
    for (std::size_t i = 0; i < boxes.size(); ++i)
      placed.push_back({{Solid::Shape::kBox, Vector3d::Zero(), boxes[i].half_size, thing.rgb[i], 0}, boxes[i].T_frame_box});
  }
  return placed;
}

/// The first surface that the ray meets of the room, where `hit` is, and of the things.
std::optional<RayHit> first_hit(std::optional<RayHit> hit, const std::vector<PlacedSolid>& things, const Vector3d& origin,
                                const Vector3d& direction) {
  for (const PlacedSolid& thing : things) {
    const Eigen::Matrix3d to_solid = thing.T_world_solid.linear().transpose();
    const Vector3d own_origin = to_solid * (origin - thing.T_world_solid.translation()), own_direction = to_solid * direction;
    const double t = cast_box(thing.solid, own_origin, own_direction.cwiseInverse());
    if (t >= (hit ? hit->distance : kNever)) continue;
    const Vector3d normal = thing.T_world_solid.linear() * normal_at(thing.solid, own_origin + t * own_direction);
    hit = RayHit{t, normal, shaded(thing.solid, origin + t * direction, normal)};
  }
  return hit;
}

/// Everything that stands still.
Solids all_solids() {
  Solids solids = shell();
  append(solids, table_and_chair());
  append(solids, shelf());
  append(solids, along_the_walls());
  return solids;
}

struct RoomView {
  RecordedFrame frame;    ///< depth CV_32FC1 [m]
  cv::Mat cos_incidence;  ///< CV_32FC1
};

RoomView view_room(const Room& room, CameraPath path, int index, int frames, const Intrinsics& intrinsics) {
  const Eigen::Isometry3d T_world_camera = camera_pose(path, index, frames);
  const std::vector<PlacedSolid> things = placed_at(room.things(), index);
  const View view = render_view(T_world_camera, intrinsics, [&](const Vector3d& origin, const Vector3d& direction) {
    return first_hit(room.cast(origin, direction), things, origin, direction);
  });
  return {{static_cast<std::size_t>(index), kFirstStamp + index / kFrameRate, view.depth, view.color, intrinsics, T_world_camera},
          view.cos_incidence};
}

}  // namespace

Room::Room(Scene scene, int frames) : World(all_solids()), things_(scene_things(scene, frames)) {}

RecordedFrame Room::render(int index, int frames, const Intrinsics& intrinsics, CameraPath path) const {
  return view_room(*this, path, index, frames, intrinsics).frame;
}

RecordedFrame Room::render(int index, int frames, const Intrinsics& intrinsics, const SensorModel& sensor, CameraPath path) const {
  return sense(index, frames, intrinsics, sensor, path).measured;
}

SensedFrame Room::sense(int index, int frames, const Intrinsics& intrinsics, const SensorModel& sensor, CameraPath path) const {
  const RoomView view = view_room(*this, path, index, frames, intrinsics);
  SensedFrame sensed{view.frame, view.frame};
  sensed.measured.depth = measure(view.frame.depth, view.cos_incidence, sensor, index);
  sensed.measured.T_world_camera = tracked(view.frame.T_world_camera, sensor, index);
  return sensed;
}

Eigen::Isometry3d orbit_pose(int index, int frames) { return camera_pose(CameraPath::kOrbit, index, frames); }

Intrinsics synthetic_camera(int width, int height) {
  const double scale_x = width / 640.0, scale_y = height / 480.0;
  return {525.0 * scale_x, 520.0 * scale_y, 313.2 * scale_x, 246.8 * scale_y, width, height};
}

}  // namespace frontier_surfels::replay
