/// How much of what can be seen of a scene at all has been seen, or is in a map.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "synthetic/surface_points.hpp"

namespace frontier_surfels::replay {

struct CoverageOptions {
  double spacing = 0.05;          ///< [m] of the points on the surfaces
  double lattice = 0.25;          ///< [m] between positions of the camera
  double lowest = 0.4;            ///< [m] of the positions that the camera can take: lowest z ...
  double highest = 2.1;           ///< [m] ... and highest
  double clearance = 0.2;         ///< [m] from the camera to the nearest surface
  double z_min = 0.5;             ///< [m] range of the sensor
  double z_max = 3;               ///< [m]
  double max_incidence = 85;      ///< [degree] between the line to the camera and the normal of the surface
  double depth_tolerance = 0.02;  ///< [m]
  double noise_growth = 0;        ///< [1/m] standard deviation of a depth z over z^2; of a Kinect 1.425e-3
  double surfel_distance = 0.05;  ///< [m]
  double depth_unit = 0.001;      ///< [m] of 16-bit images
  int threads = 0;                ///< 0: as many as the machine has

  /// @throws Error  what is wrong with the first field that cannot be used
  void check() const;
};

/// The points that can be seen, and which of them have been.
///
/// The surfaces are surface_points(), each of which stands for the same area. A point CAN BE SEEN if there is a position of the camera
/// * on the lattice: whole multiples of `lattice` from `start`, within `bounds` and from `lowest` to `highest`, the nearest surface at
///   least `clearance` away, and reached from `start` by steps to neighbours on the lattice (along the axes) with that clearance all along;
/// * from which nothing hides the point, at a distance from z_min to z_max, under an angle of incidence of less than max_incidence. As the
///   camera can turn to any side, that is all.
///
/// Such a point is SEEN by an image if it lies in the frustum with its z from z_min to z_max, under less than max_incidence, and if the
/// nearest pixel has a depth in that range that differs by at most
///     depth_tolerance + 3 noise_growth z^2 + 0.71 z / (f cos(incidence)):
/// the last term because the centre of the pixel is up to 0.71 pixels away, where the point's own face may be that much nearer or farther.
///
/// It is MAPPED if the centre of an occupied surfel is at most surfel_distance away.
///
/// All results are the same for any number of threads.
class Coverage {
 public:
  /// Takes seconds. @param bounds  what the camera cannot leave. @param start  position of the camera, in free space
  /// @throws Error if an option or `start` cannot be used, or if nothing can be seen
  Coverage(const World& world, const Eigen::AlignedBox3d& bounds, const Eigen::Vector3d& start, const CoverageOptions& options = {});

  /// Counts what an image sees. Takes milliseconds.
  /// @param frame  with its true pose. @return points that are seen for the first time
  /// @throws BadFrame if image and intrinsics do not belong together, or the pose is not finite
  std::size_t add(const DepthFrame& frame);

  /// Forgets all images.
  void reset();

  /// The points that can be seen.
  const std::vector<SurfacePoint>& points() const { return points_; }

  /// For each point whether it has been seen: 0 or 1.
  const std::vector<std::uint8_t>& seen() const { return seen_; }

  std::size_t seen_points() const { return points_.size() - unseen_.size(); }

  /// Share of the points that has been seen, from 0 to 1.
  double share() const { return static_cast<double>(seen_points()) / static_cast<double>(points_.size()); }

  /// For each point whether it is mapped: 0 or 1.
  std::vector<std::uint8_t> mapped(const std::vector<Surfel>& surfels) const;

  /// Share of the points that is mapped, from 0 to 1.
  double mapped_share(const std::vector<Surfel>& surfels) const;

  /// The positions from which points can be seen.
  const std::vector<Eigen::Vector3d>& positions() const { return positions_; }

 private:
  /// The points in cubic cells as wide as surfel_distance.
  struct Cells {
    Eigen::Vector3d low = Eigen::Vector3d::Zero();
    Eigen::Array3i size = Eigen::Array3i::Zero();
    std::vector<std::uint32_t> first;   ///< for each cell the place of its first point in `points`, and one more
    std::vector<std::uint32_t> points;  ///< indices
    std::size_t index(const Eigen::Array3i& cell) const {
      return (static_cast<std::size_t>(cell.z()) * static_cast<std::size_t>(size.y()) + static_cast<std::size_t>(cell.y())) *
                 static_cast<std::size_t>(size.x()) +
             static_cast<std::size_t>(cell.x());
    }
  };

  void sort_into_cells();

  CoverageOptions options_;
  double min_cosine_ = 0;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<SurfacePoint> points_;
  std::vector<std::uint8_t> seen_;
  std::vector<std::uint32_t> unseen_;  ///< ascending
  Cells cells_;
};

}  // namespace frontier_surfels::replay
