#include "ros/output/marker_shapes.hpp"

#include <algorithm>

#include "ros/input/conversions.hpp"

namespace frontier_surfels {
namespace {

using messages::to_point;
using visualization_msgs::Marker;

constexpr double kPyramidDepth = 0.5;  ///< [m]
constexpr double kTextHeight = 0.08;   ///< [m]
constexpr double kTextAbove = 0.3;     ///< [m] above the camera

std_msgs::ColorRGBA to_color(const Eigen::Vector3f& rgb) {
  std_msgs::ColorRGBA color;
  color.r = rgb.x();
  color.g = rgb.y();
  color.b = rgb.z();
  color.a = 1;
  return color;
}

bool has_color(const Surfel& surfel) { return surfel.rgb[0] != 0 || surfel.rgb[1] != 0 || surfel.rgb[2] != 0; }

/// rviz does not light triangles that have colours of their own. Without the shading here, shapes of one colour could not be recognised.
std_msgs::ColorRGBA color_of(const Surfel& surfel) {
  static const Eigen::Vector3f to_light = Eigen::Vector3f(0.4f, 0.3f, 0.85f).normalized();
  const float lit = 0.5f + 0.5f * surfel.normal.dot(to_light);  // 0 ... 1
  if (surfel.label == Label::kFrontier) return to_color((0.65f + 0.35f * lit) * Eigen::Vector3f(0.15f, 0.35f, 1));
  if (!has_color(surfel)) return to_color(Eigen::Vector3f::Constant(0.25f + 0.65f * lit));
  return to_color(Eigen::Vector3f(surfel.rgb[0], surfel.rgb[1], surfel.rgb[2]) / 255);
}

/// A direction in the plane of a surfel, as near as possible to an axis of the world: squares of a wall then lie side by side.
Eigen::Vector3d tangent(const Eigen::Vector3d& normal) {
  int axis;
  normal.cwiseAbs().minCoeff(&axis);
  const Eigen::Vector3d across = Eigen::Vector3d::Unit(axis) - normal[axis] * normal;
  return across.normalized();
}

}  // namespace

void MergedSurfels::add(const Surfel& surfel) {
  if (count_++ == 0) first_ = surfel;
  position_ += surfel.position.cast<double>();
  normal_ += surfel.normal.cast<double>();
  radius_ += surfel.radius;
  if (!has_color(surfel)) return;
  ++colored_;
  rgb_ += Eigen::Vector3d(surfel.rgb[0], surfel.rgb[1], surfel.rgb[2]);
}

Surfel MergedSurfels::mean(double half_side) const {
  Surfel mean = first_;
  if (count_ == 0) return mean;
  mean.position = (position_ / count_).cast<float>();
  if (normal_.norm() > 1e-6) mean.normal = normal_.normalized().cast<float>();
  mean.radius = static_cast<float>(std::max(half_side, radius_ / count_));
  if (colored_ > 0)
    for (int channel = 0; channel < 3; ++channel) mean.rgb[channel] = static_cast<std::uint8_t>(rgb_[channel] / colored_ + 0.5);
  return mean;
}

void MarkerSquares::add(const Surfel& surfel) {
  const Eigen::Vector3d p = surfel.position.cast<double>(), n = surfel.normal.cast<double>();
  const Eigen::Vector3d u = tangent(n) * surfel.radius, v = n.cross(u);
  const geometry_msgs::Point corners[] = {to_point(p - u - v), to_point(p + u - v), to_point(p + u + v), to_point(p - u + v)};
  for (const int corner : {0, 1, 2, 0, 2, 3}) points.push_back(corners[corner]);
  colors.insert(colors.end(), 6, color_of(surfel));
}

Marker marker(const std_msgs::Header& header, const std::string& ns, int id, int type) {
  Marker marker;
  marker.header = header;
  marker.ns = ns;
  marker.id = id;
  marker.type = type;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1;
  marker.scale.x = marker.scale.y = marker.scale.z = 1;
  marker.color.r = marker.color.g = marker.color.b = marker.color.a = 1;  // alpha also applies to the colours of points
  return marker;
}

Marker deletion(const std_msgs::Header& header, const std::string& ns, int id) {
  Marker marker = frontier_surfels::marker(header, ns, id, Marker::TRIANGLE_LIST);
  marker.action = Marker::DELETE;
  return marker;
}

Marker deletion_of_all(const std_msgs::Header& header) {
  Marker marker = deletion(header, "", 0);
  marker.action = Marker::DELETEALL;
  return marker;
}

Marker view_pyramid(const std_msgs::Header& header, const CameraView& camera) {
  Marker lines = marker(header, "camera", 0, Marker::LINE_LIST);
  lines.scale.x = 0.01;
  lines.color.b = 0.2f;
  const Intrinsics& i = camera.intrinsics;
  const double z = std::min(camera.z_max, kPyramidDepth);
  const double left = -0.5, right = i.width - 0.5, top = -0.5, bottom = i.height - 0.5;  // pixel centres are at whole numbers
  const auto corner = [&](double u, double v) {
    return to_point(camera.T_world_camera * Eigen::Vector3d((u - i.cx) / i.fx * z, (v - i.cy) / i.fy * z, z));
  };
  const geometry_msgs::Point apex = to_point(camera.T_world_camera.translation());
  const geometry_msgs::Point corners[] = {corner(left, top), corner(right, top), corner(right, bottom), corner(left, bottom)};
  for (int k = 0; k < 4; ++k) lines.points.insert(lines.points.end(), {apex, corners[k], corners[k], corners[(k + 1) % 4]});
  return lines;
}

Marker counts_text(const std_msgs::Header& header, const CameraView* camera, std::size_t occupied, std::size_t frontier) {
  Marker text = marker(header, "counts", 0, Marker::TEXT_VIEW_FACING);
  Eigen::Vector3d position(0, 0, kTextAbove);
  if (camera) position += camera->T_world_camera.translation();
  text.pose.position = to_point(position);
  text.scale.z = kTextHeight;
  text.text = std::to_string(occupied) + " occupied\n" + std::to_string(frontier) + " frontier";
  return text;
}

}  // namespace frontier_surfels
