#include "ros/output/cluster_markers.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "ros/input/conversions.hpp"
#include "ros/output/marker_shapes.hpp"

namespace frontier_surfels {
namespace {

using messages::to_point;
using visualization_msgs::Marker;

constexpr double kTextHeight = 0.12, kArrowLength = 0.3;  // [m]
constexpr double kGoldenRatio = 0.61803398875;            // steps of the hue: ids that follow each other look different

std_msgs::ColorRGBA color_of(std::uint32_t id) {
  const double hue = 6 * (id * kGoldenRatio - std::floor(id * kGoldenRatio));
  const auto channel = [&](double shift) {
    const double h = std::fmod(hue + shift, 6.0);
    return static_cast<float>(std::clamp(std::abs(h - 3) - 1, 0.0, 1.0));
  };
  std_msgs::ColorRGBA color;
  color.r = channel(0);
  color.g = channel(4);
  color.b = channel(2);
  color.a = 1;
  return color;
}

}  // namespace

visualization_msgs::MarkerArray cluster_markers(const std_msgs::Header& header, const std::vector<Cluster>& clusters) {
  visualization_msgs::MarkerArray array;
  array.markers.push_back(deletion_of_all(header));
  int arrows = 0;
  for (const Cluster& cluster : clusters) {
    const int id = static_cast<int>(cluster.id);
    Marker points = marker(header, "clusters", id, Marker::POINTS);
    points.color = color_of(cluster.id);
    points.scale.x = points.scale.y = 0.04;
    for (const ClusterPoint& point : cluster.points) points.points.push_back(to_point(point.position));
    array.markers.push_back(points);

    Marker number = marker(header, "numbers", id, Marker::TEXT_VIEW_FACING);
    number.pose.position = to_point(cluster.centroid + 0.15F * cluster.normal);
    number.scale.z = kTextHeight;
    number.text = std::to_string(cluster.id);
    array.markers.push_back(number);

    for (const ClusterViewpoint& viewpoint : cluster.viewpoints) {
      Marker arrow = marker(header, "viewpoints", arrows++, Marker::ARROW);
      arrow.color = points.color;
      arrow.scale.x = 0.02;
      arrow.scale.y = 0.05;
      arrow.scale.z = 0.08;
      const Eigen::Vector3f from = viewpoint.T_world_camera.translation();
      arrow.points = {to_point(from), to_point(from + static_cast<float>(kArrowLength) * viewpoint.T_world_camera.linear().col(2))};
      array.markers.push_back(arrow);
    }
  }
  return array;
}

}  // namespace frontier_surfels
