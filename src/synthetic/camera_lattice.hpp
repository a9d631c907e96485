/// The places of a regular lattice that a camera can reach.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "synthetic/world.hpp"

namespace frontier_surfels::replay {

class CameraLattice {
 public:
  /// @param box  the places' positions lie in it. @param start  the first of them. @param step, clearance  [m]
  /// @throws Error if `start` is not in the box, or has less than this clearance
  CameraLattice(const World& world, const Eigen::AlignedBox3d& box, const Eigen::Vector3d& start, double step, double clearance);

  /// The positions of all places that can be reached: z runs slowest, then y.
  std::vector<Eigen::Vector3d> positions() const;

  /// Calls visit(position) for those within this distance of the point along each axis, until it returns true. @return whether it did
  template <typename Visit>
  bool any_near(const Eigen::Vector3d& p, double distance, Visit&& visit) const {
    const Eigen::Array3i low = place_of(p - Eigen::Vector3d::Constant(distance)).max(0);
    const Eigen::Array3i high = (place_of(p + Eigen::Vector3d::Constant(distance)) + 1).min(size_ - 1);
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) {
          if (reached_[index({x, y, z})] && visit(position({x, y, z}))) return true;
        }
      }
    }
    return false;
  }

 private:
  Eigen::Array3i place_of(const Eigen::Vector3d& p) const { return ((p - origin_) / step_).array().floor().cast<int>(); }
  Eigen::Vector3d position(const Eigen::Array3i& place) const { return origin_ + step_ * place.cast<double>().matrix(); }
  std::size_t index(const Eigen::Array3i& place) const {
    return static_cast<std::size_t>((place.z() * size_.y() + place.y()) * size_.x() + place.x());
  }

  double step_;
  Eigen::Vector3d origin_;  ///< of place (0, 0, 0)
  Eigen::Array3i size_;
  std::vector<std::uint8_t> reached_;
};

}  // namespace frontier_surfels::replay
