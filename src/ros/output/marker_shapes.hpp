/// The shapes that ~markers is made of.
#pragma once

#include <std_msgs/Header.h>
#include <visualization_msgs/Marker.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// The camera of the last frame, for its view pyramid.
struct CameraView {
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d(Eigen::Matrix4d::Constant(std::nan("")));  ///< optical frame
  Intrinsics intrinsics;
  double z_max = 0;  ///< [m]; 0: there is no camera

  bool known() const { return z_max > 0 && T_world_camera.matrix().allFinite() && intrinsics.fx > 0 && intrinsics.fy > 0; }
};

/// Surfels of one label that are shown as one square: their means.
class MergedSurfels {
 public:
  void add(const Surfel& surfel);

  /// @param half_side  the square's at least [m]; the mean radius where that is larger
  Surfel mean(double half_side) const;

 private:
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero(), normal_ = Eigen::Vector3d::Zero(), rgb_ = Eigen::Vector3d::Zero();
  double radius_ = 0;
  int count_ = 0, colored_ = 0;
  Surfel first_;
};

/// The triangles of squares, surfels' or merged ones'.
struct MarkerSquares {
  std::vector<geometry_msgs::Point> points;
  std::vector<std_msgs::ColorRGBA> colors;

  /// A square of half side `radius` in the surfel's plane, its edges as level as can be. Occupied: in its colour, or shaded by its normal
  /// where it has none; frontier: blue, shaded a little.
  void add(const Surfel& surfel);
};

/// A marker that stays until it is replaced or deleted, at the origin of the header's frame.
visualization_msgs::Marker marker(const std_msgs::Header& header, const std::string& ns, int id, int type);
visualization_msgs::Marker deletion(const std_msgs::Header& header, const std::string& ns, int id);
visualization_msgs::Marker deletion_of_all(const std_msgs::Header& header);

/// The camera's view as lines, up to a depth that does not hide the scene.
visualization_msgs::Marker view_pyramid(const std_msgs::Header& header, const CameraView& camera);

/// How many surfels there are, above the camera, or at the origin.
visualization_msgs::Marker counts_text(const std_msgs::Header& header, const CameraView* camera, std::size_t occupied,
                                       std::size_t frontier);

}  // namespace frontier_surfels
