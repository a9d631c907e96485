/// One frame of the exact test: what it has seen, and quick bounds on that for a whole ball.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "frontier_surfels/scoring/scene_object.hpp"
#include "scoring/decimated_depth.hpp"

namespace frontier_surfels::scoring {

/// Which part of a ball a view has seen.
enum class Coverage { kNone, kSome, kAll };

class ExactView {
 public:
  ExactView(const DepthFrame& frame, const DepthReading& reading);

  int width() const { return width_; }
  int height() const { return height_; }
  bool has_measurements() const { return has_measurements_; }
  /// Depth up to which a pixel has seen free space [m]; 0: no measurement.
  float depth(int s, int t) const { return std::abs(signed_depth(s, t)); }

  /// The point at `z` [m] on the ray through the centre of a pixel, world.
  Eigen::Vector3d on_ray(int s, int t, double z) const {
    return T_world_camera_ * Eigen::Vector3d((s - cx_) * z / fx_, (t - cy_) * z / fy_, z);
  }

  /// Is the point between the camera and the end of what the pixel has seen to be free, and has nothing been put there since?
  bool sees(const Eigen::Vector3d& p_world) const { return saw(p_world) && !is_void(p_world); }

  /// As sees(), at the time of the frame.
  bool saw(const Eigen::Vector3d& p_world) const {
    double z;
    const float d = std::abs(measured_at(p_world, z));
    return d > 0 && z < d;
  }

  /// Whether something stands at the point that was not there in this frame.
  bool is_void(const Eigen::Vector3d& p_world) const {
    return std::any_of(voids_.begin(), voids_.end(), [&](const OrientedBox& box) { return box.contains(p_world); });
  }

  /// Boxes of whose points the view says nothing, world.
  void set_voids(std::vector<OrientedBox> voids) { voids_ = std::move(voids); }

  /// Is the point at or behind a measured surface, at most `thickness` [m] deep?
  bool sees_just_behind_surface(const Eigen::Vector3d& p_world, double thickness) const {
    double z;
    const float d = measured_at(p_world, z);
    return d > 0 && z >= d && z <= d + thickness;
  }

  /// Bounds sees() for all points of a ball: kNone and kAll are certain, kSome says nothing.
  Coverage coverage(const Eigen::Vector3d& centre_world, double radius) const;

 private:
  /// Side of the squares of pixels that depth bounds are kept of [pixel].
  static constexpr int kTile = 8;

  struct Bounds {
    float min = 0, max = 0;  ///< [m]; min is 0 when any pixel has no measurement
  };
  struct PixelRange {
    int first, last;  ///< inclusive, clipped to the image
    bool clipped;
  };

  /// As in DecimatedDepth::depth.
  float signed_depth(int s, int t) const { return depth_[static_cast<std::size_t>(t) * width_ + s]; }

  /// Signed depth of the pixel that a point falls in, 0 where there is none; z: the point's own depth.
  float measured_at(const Eigen::Vector3d& p_world, double& z) const {
    const Eigen::Vector3d p = T_camera_world_ * p_world;
    z = p.z();
    if (!(z > 0)) return 0;
    // Pixel centres are at whole numbers: truncation of the non-negative sum rounds to the nearest. The comparisons refuse NaN.
    const double s = fx_ * p.x() / z + cx_ + 0.5;
    const double t = fy_ * p.y() / z + cy_ + 0.5;
    if (!(s >= 0 && s < width_ && t >= 0 && t < height_)) return 0;
    return signed_depth(static_cast<int>(s), static_cast<int>(t));
  }

  void make_tiles();
  Bounds bounds(const PixelRange& columns, const PixelRange& rows) const;

  double fx_, fy_, cx_, cy_;  ///< [pixel]
  int width_, height_;        ///< [pixel]
  Eigen::Isometry3d T_camera_world_, T_world_camera_;
  std::vector<float> depth_;  ///< depth[height][width] [m], as in DecimatedDepth
  bool has_measurements_ = false;
  int tiles_per_row_ = 0;
  std::vector<Bounds> tiles_;
  std::vector<OrientedBox> voids_;
};

}  // namespace frontier_surfels::scoring
