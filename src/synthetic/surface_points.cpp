#include "synthetic/surface_points.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels::replay {
namespace {

using Eigen::Vector3d;
using Points = std::vector<SurfacePoint>;

constexpr double kLift = 1e-3;  // [m]

int cells(double length, double spacing) { return std::max(1, static_cast<int>(std::lround(length / spacing))); }

/// Middle of a cell, from -1 to 1.
double middle(int cell, int count) { return (2 * cell + 1.0) / count - 1; }

/// The two faces of a box across an axis.
void add_faces(const Solid& solid, int axis, double spacing, Points& points) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const int along_u = cells(2 * solid.half_size[u], spacing), along_v = cells(2 * solid.half_size[v], spacing);
  for (const double side : {-1.0, 1.0}) {
    for (int i = 0; i < along_u; ++i) {
      for (int j = 0; j < along_v; ++j) {
        Vector3d share;
        share[axis] = side;
        share[u] = middle(i, along_u);
        share[v] = middle(j, along_v);
        points.push_back({solid.centre + share.cwiseProduct(solid.half_size), side * Vector3d::Unit(axis)});
      }
    }
  }
}

/// The round side of a cylinder.
void add_side(const Solid& solid, double spacing, Points& points) {
  const int around = cells(2 * M_PI * solid.half_size.x(), spacing), rows = cells(2 * solid.half_size.z(), spacing);
  for (int row = 0; row < rows; ++row) {
    for (int i = 0; i < around; ++i) {
      const double angle = M_PI * middle(i, around);
      const Vector3d normal(std::cos(angle), std::sin(angle), 0);
      points.push_back({solid.centre + solid.half_size.x() * normal + Vector3d(0, 0, middle(row, rows) * solid.half_size.z()), normal});
    }
  }
}

/// Top and bottom of a cylinder, in rings.
void add_lids(const Solid& solid, double spacing, Points& points) {
  const int rings = cells(solid.half_size.x(), spacing);
  for (const double side : {-1.0, 1.0}) {
    for (int ring = 0; ring < rings; ++ring) {
      const double radius = (ring + 0.5) / rings * solid.half_size.x();
      const int around = cells(2 * M_PI * radius, spacing);
      for (int i = 0; i < around; ++i) {
        const double angle = M_PI * middle(i, around);
        const Vector3d offset(radius * std::cos(angle), radius * std::sin(angle), side * solid.half_size.z());
        points.push_back({solid.centre + offset, side * Vector3d::UnitZ()});
      }
    }
  }
}

/// A sphere in rings of equal height, which have equal areas.
void add_sphere(const Solid& solid, double spacing, Points& points) {
  const double radius = solid.half_size.x();
  const int rings = cells(2 * radius, spacing), around = cells(2 * M_PI * radius, spacing);
  for (int ring = 0; ring < rings; ++ring) {
    const double z = middle(ring, rings), flat = std::sqrt(1 - z * z);
    for (int i = 0; i < around; ++i) {
      const double angle = M_PI * middle(i, around);
      const Vector3d normal(flat * std::cos(angle), flat * std::sin(angle), z);
      points.push_back({solid.centre + radius * normal, normal});
    }
  }
}

void add(const Solid& solid, double spacing, Points& points) {
  switch (solid.shape) {
    case Solid::Shape::kSphere:
      return add_sphere(solid, spacing, points);
    case Solid::Shape::kCylinder:
      add_side(solid, spacing, points);
      return add_lids(solid, spacing, points);
    default:
      for (int axis = 0; axis < 3; ++axis) add_faces(solid, axis, spacing, points);
  }
}

}  // namespace

std::vector<SurfacePoint> surface_points(const World& world, double spacing) {
  Points points;
  for (const Solid& solid : world.solids()) add(solid, spacing, points);
  const auto is_covered = [&](const SurfacePoint& point) { return world.distance(point.position + kLift * point.normal) < kLift / 2; };
  points.erase(std::remove_if(points.begin(), points.end(), is_covered), points.end());
  return points;
}

}  // namespace frontier_surfels::replay
