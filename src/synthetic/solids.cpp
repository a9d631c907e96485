#include "synthetic/solids.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels::replay {

using Eigen::Vector3d;

namespace {

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

}  // namespace

Solid box(const Vector3d& low, const Vector3d& high, const Rgb& rgb, double tile) {
  return {Solid::Shape::kBox, (low + high) / 2, (high - low) / 2, rgb, tile};
}

Solid cylinder(const Vector3d& bottom, double radius, double height, const Rgb& rgb) {
  return {Solid::Shape::kCylinder, bottom + Vector3d(0, 0, height / 2), {radius, radius, height / 2}, rgb, 0};
}

Solid sphere(const Vector3d& centre, double radius, const Rgb& rgb) {
  return {Solid::Shape::kSphere, centre, {radius, radius, radius}, rgb, 0};
}

void append(Solids& solids, const Solids& more) { solids.insert(solids.end(), more.begin(), more.end()); }

Solids legs(const Vector3d& low, const Vector3d& high, double thickness, const Rgb& rgb) {
  Solids posts;
  for (const double x : {low.x(), high.x() - thickness}) {
    for (const double y : {low.y(), high.y() - thickness}) posts.push_back(box({x, y, 0}, {x + thickness, y + thickness, low.z()}, rgb));
  }
  return posts;
}

// Intersects the intervals of the ray that lie between opposite faces of the box. The interval of a ray that is parallel to two faces is
// empty or (-Inf, Inf).
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

}  // namespace frontier_surfels::replay
