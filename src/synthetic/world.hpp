/// A scene of solids: what rays meet, how far the nearest surface is, where a ball can go, and what a camera sees.
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "synthetic/solids.hpp"

namespace frontier_surfels::replay {

/// Where a ray meets the first surface.
struct RayHit {
  double distance = 0;                               ///< in multiples of the length of the direction vector
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit length, points out of the solid
  Rgb rgb = {0, 0, 0};
};

/// What a camera without errors sees.
struct View {
  cv::Mat depth;          ///< CV_32FC1 [m] along the optical axis; 0: no surface
  cv::Mat color;          ///< CV_8UC3, BGR
  cv::Mat cos_incidence;  ///< CV_32FC1, cosine of the angle between ray and surface normal
};

/// What becomes of a ray from `origin` along `direction`, which is 1 long along the optical axis.
using CastRay = std::function<std::optional<RayHit>(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction)>;

/// The view of a pinhole camera. Rows are shared out to `threads` threads (0: as many as the machine has), on which `cast` is called.
View render_view(const Eigen::Isometry3d& T_world_camera, const Intrinsics& intrinsics, const CastRay& cast, int threads = 1);

/// Solids that stand still, in a tree of bounding boxes. Several threads may ask it at once.
class World {
 public:
  explicit World(Solids solids);

  const Solids& solids() const { return solids_; }

  /// The first surface that a ray from free space meets, if any.
  std::optional<RayHit> cast(const Eigen::Vector3d& origin_world, const Eigen::Vector3d& direction_world) const;

  /// Whether nothing stands between two points of free space.
  bool sees(const Eigen::Vector3d& from_world, const Eigen::Vector3d& to_world) const;

  /// Exact depth along the optical axis at a point of the image [m]; +Inf if the ray meets nothing.
  double depth(const Eigen::Isometry3d& T_world_camera, const Intrinsics& intrinsics, double u, double v) const;

  /// Signed distance to the nearest surface [m]; negative in a solid. Exact in free space.
  double distance(const Eigen::Vector3d& p_world) const;

  bool inside_solid(const Eigen::Vector3d& p_world) const { return distance(p_world) < 0; }

  /// How far the centre of a ball of this radius can go from `from` straight towards `to` [m], to a millimetre; 0 if it touches a solid
  /// where it is, and the whole distance if nothing stops it.
  double free_length(const Eigen::Vector3d& from_world, const Eigen::Vector3d& to_world, double radius) const;

  View render(const Eigen::Isometry3d& T_world_camera, const Intrinsics& intrinsics, int threads = 1) const;

 private:
  /// Bounding box of some solids. The two halves of an inner node are the next node and `second`; a leaf has solids.
  struct Node {
    Eigen::AlignedBox3d box;
    int second = 0;
    int axis = 0;                     ///< along which the halves lie, the next node first
    int first_solid = 0, solids = 0;  ///< in order_; none: an inner node
  };
  struct Nearest {
    double t;
    int solid;  ///< -1: none
  };

  void build(int begin, int end);
  Nearest nearest(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double t_max) const;

  Solids solids_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace frontier_surfels::replay
