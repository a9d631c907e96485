/// The exact test of section 1 against kept views, in double precision.
#pragma once

#include <cmath>
#include <vector>

#include "frame/working_image.hpp"
#include "reference_grid.hpp"

namespace frontier_surfels::reference {

struct SeenView {
  WorkingImage image;
  Eigen::Isometry3d T_world_camera;
  double depth_step;  ///< kept depths are rounded down to a multiple of this [m]
};

/// Number of steps, 16 bits, as which a depth is kept.
inline double kept_steps(float depth, double depth_step) { return std::min(std::floor(std::abs(depth) / depth_step), 65535.0); }

/// Does a view know a point, given in its camera's frame? It does if the pixel at the point has a larger depth.
inline Truth camera_knows(const SeenView& view, const Vector3d& p) {
  if (p.z() <= 0) return p.z() > -1e-6 ? Truth::open : Truth::no;
  const Intrinsics& camera = view.image.intrinsics;
  const double s = p.x() * camera.fx / p.z() + camera.cx, t = p.y() * camera.fy / p.z() + camera.cy;
  // In float the point's image may be off by this many pixels.
  const double tolerance = 1e-4 + 4e-6 / p.z() * (camera.fx + camera.fy) * (1 + p.norm() / p.z());
  bool yes = false, no = false, open = false;
  for (const double ds : {-tolerance, tolerance})
    for (const double dt : {-tolerance, tolerance}) {
      const double column = std::floor(s + ds + 0.5), row = std::floor(t + dt + 0.5);
      const bool inside = column >= 0 && row >= 0 && column < camera.width && row < camera.height;
      const auto depth = [&] { return view.image.depth[static_cast<int>(row) * camera.width + static_cast<int>(column)]; };
      const Truth known = inside ? less(p.z(), kept_steps(depth(), view.depth_step) * view.depth_step, 1e-5) : Truth::no;
      yes = yes || known == Truth::yes;
      no = no || known == Truth::no;
      open = open || known == Truth::open;
    }
  return open || (yes && no) ? Truth::open : truth(yes);
}

inline Truth view_knows(const SeenView& view, const Vector3d& p_world) {
  return camera_knows(view, view.T_world_camera.inverse() * p_world);
}

inline Truth any_knows(const std::vector<SeenView>& views, const Vector3d& p_world) {
  Truth known = Truth::no;
  for (const SeenView& view : views) known = known || view_knows(view, p_world);
  return known;
}

}  // namespace frontier_surfels::reference
