/// The shapes in ~markers.
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
  double z_max = 0;  ///< [m]; 0 if there is no camera

  bool known() const { return z_max > 0 && T_world_camera.matrix().allFinite() && intrinsics.fx > 0 && intrinsics.fy > 0; }
};

/// Surfels of one label that are shown as one square.
class MergedSurfels {
 public:
  void add(const Surfel& surfel);

  /// The mean of all surfels that were added. Its radius is their mean radius, but at least `half_side` [m].
  Surfel mean(double half_side) const;

 private:
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero(), normal_ = Eigen::Vector3d::Zero(), rgb_ = Eigen::Vector3d::Zero();
  double radius_ = 0;
  int count_ = 0, colored_ = 0;
  Surfel first_;
};

/// The triangles of the squares that show surfels.
struct MarkerSquares {
  std::vector<geometry_msgs::Point> points;
  std::vector<std_msgs::ColorRGBA> colors;

  /// Adds a square in the surfel's plane. Its edges are 2 * radius long and as level as possible. Occupied surfels have their own colour,
  /// or a grey that depends on the normal if no colour was seen; frontier surfels are blue, slightly shaded.
  void add(const Surfel& surfel);
};

/// A marker at the origin of the header's frame. It stays until it is replaced or deleted.
visualization_msgs::Marker marker(const std_msgs::Header& header, const std::string& ns, int id, int type);
visualization_msgs::Marker deletion(const std_msgs::Header& header, const std::string& ns, int id);
visualization_msgs::Marker deletion_of_all(const std_msgs::Header& header);

/// The camera's view as the edges of a pyramid, short enough not to hide the scene.
visualization_msgs::Marker view_pyramid(const std_msgs::Header& header, const CameraView& camera);

/// A text with the numbers of surfels, above the camera, or above the origin if there is no camera.
visualization_msgs::Marker counts_text(const std_msgs::Header& header, const CameraView* camera, std::size_t occupied,
                                       std::size_t frontier);

}  // namespace frontier_surfels
