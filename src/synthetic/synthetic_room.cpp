#include "synthetic/synthetic_room.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "synthetic/synthetic_sensor.hpp"

namespace frontier_surfels::replay {
namespace {

using Eigen::Vector3d;
using Rgb = std::array<std::uint8_t, 3>;

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kFrameRate = 30;  // [Hz]
constexpr double kFirstStamp = 1;  // [s]; ROS has no time 0

Solid box(const Vector3d& low, const Vector3d& high, const Rgb& rgb, double tile = 0) {
  return {Solid::Shape::kBox, (low + high) / 2, (high - low) / 2, rgb, tile};
}

Solid cylinder(const Vector3d& bottom, double radius, double height, const Rgb& rgb) {
  return {Solid::Shape::kCylinder, bottom + Vector3d(0, 0, height / 2), {radius, radius, height / 2}, rgb, 0};
}

Solid sphere(const Vector3d& centre, double radius, const Rgb& rgb) {
  return {Solid::Shape::kSphere, centre, {radius, radius, radius}, rgb, 0};
}

using Solids = std::vector<Solid>;

void append(Solids& solids, const Solids& more) { solids.insert(solids.end(), more.begin(), more.end()); }

/// Four posts below the plate from `low` to `high`.
Solids legs(const Vector3d& low, const Vector3d& high, double thickness, const Rgb& rgb) {
  Solids posts;
  for (const double x : {low.x(), high.x() - thickness}) {
    for (const double y : {low.y(), high.y() - thickness}) posts.push_back(box({x, y, 0}, {x + thickness, y + thickness, low.z()}, rgb));
  }
  return posts;
}

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

/// Intersects the intervals of the ray that lie between opposite faces of the box. The interval of a ray that is parallel to two faces is
/// empty or (-Inf, Inf).
double cast_box(const Solid& solid, const Vector3d& origin, const Vector3d& inverse_direction) {
  double enter = -kNever, leave = kNever;
  for (int axis = 0; axis < 3; ++axis) {
    const double offset = solid.centre[axis] - origin[axis];
    const double low = (offset - solid.half_size[axis]) * inverse_direction[axis];
    const double high = (offset + solid.half_size[axis]) * inverse_direction[axis];
    enter = std::max(enter, std::min(low, high));
    leave = std::min(leave, std::max(low, high));
  }
  return enter > 0 && enter < leave ? enter : kNever;
}

/// The smaller root of a t^2 - 2 b t + c = 0, or kNever.
double first_root(double a, double b, double c) {
  const double discriminant = b * b - a * c;
  return discriminant > 0 && a > 0 ? (b - std::sqrt(discriminant)) / a : kNever;
}

double cast_sphere(const Solid& solid, const Vector3d& origin, const Vector3d& direction) {
  const Vector3d to_centre = solid.centre - origin;
  const double t =
      first_root(direction.squaredNorm(), direction.dot(to_centre), to_centre.squaredNorm() - std::pow(solid.half_size.x(), 2));
  return t > 0 ? t : kNever;
}

double cast_cylinder(const Solid& solid, const Vector3d& origin, const Vector3d& direction) {
  const Vector3d to_centre = solid.centre - origin;
  const double radius = solid.half_size.x();
  const auto flat = [](const Vector3d& v) { return v.head<2>(); };
  const double side =
      first_root(flat(direction).squaredNorm(), flat(direction).dot(flat(to_centre)), flat(to_centre).squaredNorm() - radius * radius);
  if (side > 0 && std::abs(side * direction.z() - to_centre.z()) <= solid.half_size.z()) return side;
  const double cap = (to_centre.z() - std::copysign(solid.half_size.z(), direction.z())) / direction.z();
  return cap > 0 && flat(cap * direction - to_centre).norm() <= radius ? cap : kNever;
}

double cast_solid(const Solid& solid, const Vector3d& origin, const Vector3d& direction, const Vector3d& inverse_direction) {
  switch (solid.shape) {
    case Solid::Shape::kSphere:
      return cast_sphere(solid, origin, direction);
    case Solid::Shape::kCylinder:
      return cast_cylinder(solid, origin, direction);
    default:
      return cast_box(solid, origin, inverse_direction);
  }
}

double distance_to(const Solid& solid, const Vector3d& p) {
  const Vector3d offset = p - solid.centre;
  if (solid.shape == Solid::Shape::kSphere) return offset.norm() - solid.half_size.x();
  Vector3d beyond = offset.cwiseAbs() - solid.half_size;
  if (solid.shape == Solid::Shape::kCylinder) beyond = {offset.head<2>().norm() - solid.half_size.x(), beyond.z(), -kNever};
  return beyond.cwiseMax(0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

/// Normal of the surface at a point `p` of it.
Vector3d normal_at(const Solid& solid, const Vector3d& p) {
  const Vector3d offset = p - solid.centre;
  if (solid.shape == Solid::Shape::kSphere) return offset.normalized();
  const Vector3d beyond = offset.cwiseAbs() - solid.half_size;
  if (solid.shape == Solid::Shape::kCylinder && offset.head<2>().norm() - solid.half_size.x() > beyond.z()) {
    return Vector3d(offset.x(), offset.y(), 0).normalized();
  }
  int axis = 2;
  if (solid.shape == Solid::Shape::kBox) beyond.maxCoeff(&axis);
  return std::copysign(1.0, offset[axis]) * Vector3d::Unit(axis);
}

Rgb shaded(const Solid& solid, const Vector3d& p, const Vector3d& normal) {
  static const Vector3d kLight = Vector3d(0.3, 0.5, 0.8).normalized();
  double brightness = 0.8 + 0.2 * normal.dot(kLight);
  if (solid.tile > 0) {
    // The point is moved a little inwards, because the pattern would flicker on surfaces that are borders of tiles.
    const Vector3d cell = ((p - 1e-6 * normal) / solid.tile).array().floor();
    if (std::fmod(std::abs(cell.sum()), 2) == 1) brightness *= 0.7;
  }
  Rgb rgb = solid.rgb;
  for (std::uint8_t& channel : rgb) channel = static_cast<std::uint8_t>(std::lround(channel * brightness));
  return rgb;
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

struct View {
  RecordedFrame frame;    ///< depth CV_32FC1 [m]
  cv::Mat cos_incidence;  ///< CV_32FC1
};

View render_view(const Room& room, CameraPath path, int index, int frames, const Intrinsics& intrinsics) {
  const cv::Size size(intrinsics.width, intrinsics.height);
  View view{{}, cv::Mat::zeros(size, CV_32FC1)};
  view.frame.index = static_cast<std::size_t>(index);
  view.frame.stamp = kFirstStamp + index / kFrameRate;
  view.frame.depth = cv::Mat::zeros(size, CV_32FC1);
  view.frame.color = cv::Mat::zeros(size, CV_8UC3);
  view.frame.intrinsics = intrinsics;
  view.frame.T_world_camera = camera_pose(path, index, frames);
  const std::vector<PlacedSolid> things = placed_at(room.things(), index);
  const Vector3d origin = view.frame.T_world_camera.translation();
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column) {
      const Vector3d ray((column - intrinsics.cx) / intrinsics.fx, (row - intrinsics.cy) / intrinsics.fy, 1);
      const Vector3d direction = view.frame.T_world_camera.linear() * ray;
      const std::optional<RayHit> hit = first_hit(room.cast(origin, direction), things, origin, direction);
      if (!hit) continue;
      view.frame.depth.at<float>(row, column) = static_cast<float>(hit->distance);
      view.frame.color.at<cv::Vec3b>(row, column) = {hit->rgb[2], hit->rgb[1], hit->rgb[0]};
      view.cos_incidence.at<float>(row, column) = static_cast<float>(std::abs(hit->normal.dot(direction.normalized())));
    }
  }
  return view;
}

}  // namespace

Room::Room(Scene scene, int frames) : solids_(shell()), things_(scene_things(scene, frames)) {
  append(solids_, table_and_chair());
  append(solids_, shelf());
  append(solids_, along_the_walls());
}

std::optional<RayHit> Room::cast(const Vector3d& origin_world, const Vector3d& direction_world) const {
  const Vector3d inverse_direction = direction_world.cwiseInverse();
  const Solid* first = nullptr;
  double nearest = kNever;
  for (const Solid& solid : solids_) {
    const double t = cast_solid(solid, origin_world, direction_world, inverse_direction);
    if (t < nearest) {
      nearest = t;
      first = &solid;
    }
  }
  if (first == nullptr) return std::nullopt;
  const Vector3d p_world = origin_world + nearest * direction_world;
  const Vector3d normal = normal_at(*first, p_world);
  return RayHit{nearest, normal, shaded(*first, p_world, normal)};
}

double Room::depth(const Eigen::Isometry3d& T_world_camera, const Intrinsics& intrinsics, double u, double v) const {
  const Vector3d ray((u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy, 1);  // of length 1 along the optical axis
  const std::optional<RayHit> hit = cast(T_world_camera.translation(), T_world_camera.linear() * ray);
  return hit ? hit->distance : kNever;
}

double Room::distance(const Vector3d& p_world) const {
  double nearest = kNever;
  for (const Solid& solid : solids_) nearest = std::min(nearest, distance_to(solid, p_world));
  return nearest;
}

RecordedFrame Room::render(int index, int frames, const Intrinsics& intrinsics, CameraPath path) const {
  return render_view(*this, path, index, frames, intrinsics).frame;
}

RecordedFrame Room::render(int index, int frames, const Intrinsics& intrinsics, const SensorModel& sensor, CameraPath path) const {
  return sense(index, frames, intrinsics, sensor, path).measured;
}

SensedFrame Room::sense(int index, int frames, const Intrinsics& intrinsics, const SensorModel& sensor, CameraPath path) const {
  const View view = render_view(*this, path, index, frames, intrinsics);
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
