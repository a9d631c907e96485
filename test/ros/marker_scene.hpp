/// What a subscriber of ~markers sees: rviz without a window.
#pragma once

#include <gtest/gtest.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

inline Eigen::Vector3d to_vector(const geometry_msgs::Point& p) { return {p.x, p.y, p.z}; }

/// A square that is shown.
struct Square {
  Label label;
  Eigen::Vector3d center, normal;
  double half_side;
  Eigen::Vector3d corner;
  std_msgs::ColorRGBA color;
};

/// Distance of a surfel's centre from the square, in its plane; at most 0 if the centre is inside.
inline double distance(const Surfel& surfel, const Square& square) {
  const Eigen::Vector3d to_surfel = surfel.position.cast<double>() - square.center;
  const Eigen::Vector3d u = (square.corner - square.center).normalized(), v = square.normal.cross(u);  // diagonals
  const double along = std::abs(to_surfel.dot(u)) + std::abs(to_surfel.dot(v)) - std::sqrt(2) * square.half_side;
  return std::max(along, std::abs(to_surfel.dot(square.normal)) - 1e-5);
}

/// All markers that are shown. Markers that rviz would not show, or would show wrongly, are failures of the test.
class Scene {
 public:
  /// @param block  edge of the cubes within which every marker must lie [m]
  void apply(const MarkerArray& message, double block = 0.5) {
    for (const Marker& marker : message.markers) {
      EXPECT_EQ(marker.header.frame_id, "map");
      EXPECT_TRUE(marker.lifetime.isZero());
      const auto key = std::make_pair(marker.ns, marker.id);
      if (marker.action == Marker::DELETEALL) {
        EXPECT_EQ(&marker, &message.markers.front()) << "rviz deletes the markers before it as well";
        markers_.clear();
      } else if (marker.action == Marker::DELETE) {
        EXPECT_EQ(markers_.erase(key), 1U) << "there was no " << marker.ns << " " << marker.id;
      } else {
        EXPECT_EQ(marker.action, Marker::ADD);
        check(marker, block);
        markers_[key] = marker;
      }
    }
  }

  const Marker* find(const std::string& ns, int id) const {
    const auto found = markers_.find({ns, id});
    return found == markers_.end() ? nullptr : &found->second;
  }

  std::vector<Square> squares() const {
    std::vector<Square> squares;
    for (const auto& [key, marker] : markers_) {
      if (marker.type != Marker::TRIANGLE_LIST) continue;
      for (std::size_t n = 0; n < marker.points.size(); n += 6) squares.push_back(square(marker, n));
    }
    return squares;
  }

 private:
  static void check(const Marker& marker, double block) {
    EXPECT_EQ(marker.pose.orientation.w, 1);
    EXPECT_GT(marker.color.a, 0.999F) << "rviz would show nothing";
    if (marker.type == Marker::TEXT_VIEW_FACING) return;
    EXPECT_FALSE(marker.points.empty());
    EXPECT_EQ(marker.pose.position.x, 0);
    if (marker.type != Marker::TRIANGLE_LIST) return;
    EXPECT_EQ(marker.colors.size(), marker.points.size());
    EXPECT_EQ(marker.points.size() % 6, 0U);
    EXPECT_EQ(marker.scale.x * marker.scale.y * marker.scale.z, 1);
    Eigen::AlignedBox3d box;
    for (std::size_t n = 0; n < marker.points.size(); n += 6) box.extend(square(marker, n).center);
    EXPECT_LE(box.sizes().maxCoeff(), block + 1e-4);
  }

  /// The two triangles are a, b, c and a, c, d.
  static Square square(const Marker& marker, std::size_t n) {
    const auto point = [&](std::size_t i) { return to_vector(marker.points[n + i]); };
    const Eigen::Vector3d a = point(0), b = point(1), c = point(2), d = point(5);
    EXPECT_EQ((point(3) - a).norm() + (point(4) - c).norm(), 0);
    EXPECT_LT(((b - a) + (d - c)).norm(), 1e-9);
    EXPECT_LT(std::abs((b - a).dot(d - a)), 1e-6 * (b - a).squaredNorm());
    EXPECT_NEAR((b - a).norm(), (d - a).norm(), 1e-6);
    const Label label = marker.ns == "occupied" ? Label::kOccupied : Label::kFrontier;
    EXPECT_TRUE(label == Label::kOccupied || marker.ns == "frontier");
    return {label, (a + c) / 2, (b - a).cross(d - a).normalized(), (b - a).norm() / 2, b, marker.colors[n]};
  }

  std::map<std::pair<std::string, int>, Marker> markers_;
};

}  // namespace frontier_surfels
