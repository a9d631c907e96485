/// Points all over a box, and on the faces with which it moves ahead.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

namespace frontier_surfels {

/// Points of a box, evenly spread along each axis from face to face, at most `step` [m] apart.
class BoxLattice {
 public:
  BoxLattice(const Eigen::Vector3f& size, double step)
      : size_(size), counts_((size.cast<double>().array() / step).ceil().cast<int>() + 1) {}

  double points() const { return counts_.cast<double>().prod(); }

  /// Appends all points. @param low  the box's lowest corner
  void append(const Eigen::Vector3f& low, std::vector<Eigen::Vector3f>& points) const { append({0, 0, 0}, counts_ - 1, low, points); }

  /// Appends the points of the face that looks ahead along each axis on which the box moves. Those of edges between them come twice.
  void append_front(const Eigen::Vector3f& way, const Eigen::Vector3f& low, std::vector<Eigen::Vector3f>& points) const {
    for (int axis = 0; axis < 3; ++axis) {
      if (way[axis] == 0) continue;
      Eigen::Array3i first(0, 0, 0), last = counts_ - 1;
      (way[axis] > 0 ? first : last)[axis] = way[axis] > 0 ? last[axis] : 0;
      append(first, last, low, points);
    }
  }

  /// Number of points that append_front() appends.
  double points_of_front(const Eigen::Vector3f& way) const {
    double sum = 0;
    for (int axis = 0; axis < 3; ++axis)
      if (way[axis] != 0) sum += points() / counts_[axis];
    return sum;
  }

 private:
  void append(const Eigen::Array3i& first, const Eigen::Array3i& last, const Eigen::Vector3f& low,
              std::vector<Eigen::Vector3f>& points) const {
    const auto at = [&](int axis, int n) {
      return low[axis] + size_[axis] * (static_cast<float>(n) / static_cast<float>(counts_[axis] - 1));
    };
    for (int k = first.z(); k <= last.z(); ++k)
      for (int j = first.y(); j <= last.y(); ++j)
        for (int i = first.x(); i <= last.x(); ++i) points.emplace_back(at(0, i), at(1, j), at(2, k));
  }

  Eigen::Vector3f size_;
  Eigen::Array3i counts_;  ///< at least 2 along each axis
};

}  // namespace frontier_surfels
