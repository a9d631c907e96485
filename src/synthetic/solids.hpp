/// The simple solids that synthetic scenes are made of: where rays meet them, how far away they are, and what they look like.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

namespace frontier_surfels::replay {

using Rgb = std::array<std::uint8_t, 3>;

constexpr double kNever = std::numeric_limits<double>::infinity();  ///< the distance of what a ray does not meet

/// A visible object. z points up.
struct Solid {
  enum class Shape { kBox, kCylinder, kSphere };  // boxes have their edges along the axes, cylinders stand upright
  Shape shape = Shape::kBox;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();     ///< [m]
  Eigen::Vector3d half_size = Eigen::Vector3d::Zero();  ///< of the bounding box [m]
  Rgb rgb = {0, 0, 0};
  double tile = 0;  ///< edge of the tiles of a chequered pattern [m]; 0: plain
};

using Solids = std::vector<Solid>;

Solid box(const Eigen::Vector3d& low, const Eigen::Vector3d& high, const Rgb& rgb, double tile = 0);
Solid cylinder(const Eigen::Vector3d& bottom, double radius, double height, const Rgb& rgb);
Solid sphere(const Eigen::Vector3d& centre, double radius, const Rgb& rgb);

/// Four posts from the floor, z = 0, to the plate from `low` to `high`.
Solids legs(const Eigen::Vector3d& low, const Eigen::Vector3d& high, double thickness, const Rgb& rgb);

void append(Solids& solids, const Solids& more);

/// Where a ray enters the box, in lengths of the direction; kNever if it does not, also for a ray from within.
double cast_box(const Solid& solid, const Eigen::Vector3d& origin, const Eigen::Vector3d& inverse_direction);

/// The same for any solid. A ray from within a solid gives no useful result.
double cast_solid(const Solid& solid, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                  const Eigen::Vector3d& inverse_direction);

/// Signed distance of the point to the surface [m]; negative in the solid. Exact outside.
double distance_to(const Solid& solid, const Eigen::Vector3d& p);

/// Normal of the surface at a point `p` of it: of unit length, out of the solid.
Eigen::Vector3d normal_at(const Solid& solid, const Eigen::Vector3d& p);

/// The colour at a point of the surface, darker where the normal points away from the light.
Rgb shaded(const Solid& solid, const Eigen::Vector3d& p, const Eigen::Vector3d& normal);

}  // namespace frontier_surfels::replay
