#include "synthetic/world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "scoring/parallel.hpp"

namespace frontier_surfels::replay {
namespace {

using Eigen::Vector3d;

constexpr int kLeaf = 2;          // solids
constexpr int kDepth = 64;        // nodes that wait at most: far more than the logarithm of any number of solids
constexpr double kMargin = 1e-6;  // [m] around bounding boxes, for rounding
constexpr double kTouch = 1e-3;   // [m]
constexpr int kBand = 8;          // rows that a thread renders at once

/// Whether the ray meets the box before t_max. It may say yes for a ray that passes by closely.
bool meets(const Eigen::AlignedBox3d& box, const Vector3d& origin, const Vector3d& inverse_direction, double t_max) {
  double enter = 0, leave = t_max;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = (box.min()[axis] - origin[axis]) * inverse_direction[axis];
    const double high = (box.max()[axis] - origin[axis]) * inverse_direction[axis];
    enter = std::max(enter, std::min(low, high));
    leave = std::min(leave, std::max(low, high));
  }
  return enter <= leave;
}

}  // namespace

View render_view(const Eigen::Isometry3d& T_world_camera, const Intrinsics& intrinsics, const CastRay& cast, int threads) {
  const cv::Size size(intrinsics.width, intrinsics.height);
  View view{cv::Mat::zeros(size, CV_32FC1), cv::Mat::zeros(size, CV_8UC3), cv::Mat::zeros(size, CV_32FC1)};
  const Vector3d origin = T_world_camera.translation();
  const auto render_row = [&](int row) {
    for (int column = 0; column < size.width; ++column) {
      const Vector3d ray((column - intrinsics.cx) / intrinsics.fx, (row - intrinsics.cy) / intrinsics.fy, 1);
      const Vector3d direction = T_world_camera.linear() * ray;
      const std::optional<RayHit> hit = cast(origin, direction);
      if (!hit) continue;
      view.depth.at<float>(row, column) = static_cast<float>(hit->distance);
      view.color.at<cv::Vec3b>(row, column) = {hit->rgb[2], hit->rgb[1], hit->rgb[0]};
      view.cos_incidence.at<float>(row, column) = static_cast<float>(std::abs(hit->normal.dot(direction.normalized())));
    }
  };
  const auto render_band = [&](std::size_t band) {
    const int first = static_cast<int>(band) * kBand;
    for (int row = first; row < std::min(size.height, first + kBand); ++row) render_row(row);
  };
  const int bands = (size.height + kBand - 1) / kBand;
  if (threads == 1) {
    for (int band = 0; band < bands; ++band) render_band(static_cast<std::size_t>(band));
  } else {
    scoring::parallel_for(static_cast<std::size_t>(bands), threads, render_band);
  }
  return view;
}

World::World(Solids solids) : solids_(std::move(solids)), order_(solids_.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (!solids_.empty()) build(0, static_cast<int>(solids_.size()));
}

/// Adds the node of some solids of order_, and all below it: halves of the same size along the longest edge of the box of the centres.
void World::build(int begin, int end) {
  const std::size_t index = nodes_.size();
  nodes_.emplace_back();
  Eigen::AlignedBox3d all, centres;
  for (int i = begin; i < end; ++i) {
    const Solid& solid = solids_[static_cast<std::size_t>(order_[static_cast<std::size_t>(i)])];
    const Vector3d half = solid.half_size + Vector3d::Constant(kMargin);
    all.extend(Eigen::AlignedBox3d(solid.centre - half, solid.centre + half));
    centres.extend(solid.centre);
  }
  nodes_[index].box = all;
  if (end - begin <= kLeaf) {
    nodes_[index].first_solid = begin;
    nodes_[index].solids = end - begin;
    return;
  }
  int axis = 0;
  centres.sizes().maxCoeff(&axis);
  nodes_[index].axis = axis;
  std::sort(order_.begin() + begin, order_.begin() + end, [&](int a, int b) {
    const double at_a = solids_[static_cast<std::size_t>(a)].centre[axis], at_b = solids_[static_cast<std::size_t>(b)].centre[axis];
    return at_a < at_b || (at_a == at_b && a < b);
  });
  const int middle = (begin + end) / 2;
  build(begin, middle);
  nodes_[index].second = static_cast<int>(nodes_.size());
  build(middle, end);
}

/// The nearest solid that the ray meets before t_max; of several at the same distance the first one in the list.
World::Nearest World::nearest(const Vector3d& origin, const Vector3d& direction, double t_max) const {
  Nearest found{t_max, -1};
  if (nodes_.empty()) return found;
  const Vector3d inverse_direction = direction.cwiseInverse();
  std::array<int, kDepth> waiting;
  int count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const int index = waiting[--count];
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    if (!meets(node.box, origin, inverse_direction, found.t)) continue;
    if (node.solids == 0) {
      const bool forwards = direction[node.axis] > 0;  // the half that the ray meets first is visited first
      waiting[count++] = forwards ? node.second : index + 1;
      waiting[count++] = forwards ? index + 1 : node.second;
      continue;
    }
    for (int i = node.first_solid; i < node.first_solid + node.solids; ++i) {
      const int solid = order_[static_cast<std::size_t>(i)];
      const double t = cast_solid(solids_[static_cast<std::size_t>(solid)], origin, direction, inverse_direction);
      if (t < found.t || (t == found.t && solid < found.solid)) found = {t, solid};
    }
  }
  return found;
}

std::optional<RayHit> World::cast(const Vector3d& origin_world, const Vector3d& direction_world) const {
  const Nearest found = nearest(origin_world, direction_world, kNever);
  if (found.solid < 0) return std::nullopt;
  const Solid& solid = solids_[static_cast<std::size_t>(found.solid)];
  const Vector3d p_world = origin_world + found.t * direction_world;
  const Vector3d normal = normal_at(solid, p_world);
  return RayHit{found.t, normal, shaded(solid, p_world, normal)};
}

bool World::sees(const Vector3d& from_world, const Vector3d& to_world) const {
  return nearest(from_world, to_world - from_world, 1).solid < 0;
}

double World::depth(const Eigen::Isometry3d& T_world_camera, const Intrinsics& intrinsics, double u, double v) const {
  const Vector3d ray((u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy, 1);  // of length 1 along the optical axis
  const std::optional<RayHit> hit = cast(T_world_camera.translation(), T_world_camera.linear() * ray);
  return hit ? hit->distance : kNever;
}

double World::distance(const Vector3d& p_world) const {
  double nearest = kNever;
  if (nodes_.empty()) return nearest;
  std::array<int, kDepth> waiting;
  int count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const int index = waiting[--count];
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    // Within a solid, all others that contain the point matter as well.
    if (node.box.exteriorDistance(p_world) > std::max(nearest, 0.0)) continue;
    if (node.solids == 0) {
      int near = index + 1, far = node.second;
      const auto squared = [&](int n) { return nodes_[static_cast<std::size_t>(n)].box.squaredExteriorDistance(p_world); };
      if (squared(far) < squared(near)) std::swap(near, far);
      waiting[count++] = far;
      waiting[count++] = near;
      continue;
    }
    for (int i = node.first_solid; i < node.first_solid + node.solids; ++i)
      nearest = std::min(nearest, distance_to(solids_[static_cast<std::size_t>(order_[static_cast<std::size_t>(i)])], p_world));
  }
  return nearest;
}

double World::free_length(const Vector3d& from_world, const Vector3d& to_world, double radius) const {
  const double length = (to_world - from_world).norm();
  const Vector3d direction = length > 0 ? Vector3d((to_world - from_world) / length) : Vector3d(Vector3d::Zero());
  double gone = 0, room = distance(from_world) - radius;
  if (!(room >= 0)) return 0;
  while (gone < length) {
    const double next = std::min(length, gone + std::max(room, kTouch));
    room = distance(from_world + next * direction) - radius;
    if (room < 0) return gone;
    gone = next;
  }
  return length;
}

View World::render(const Eigen::Isometry3d& T_world_camera, const Intrinsics& intrinsics, int threads) const {
  return render_view(
      T_world_camera, intrinsics, [this](const Vector3d& origin, const Vector3d& direction) { return cast(origin, direction); }, threads);
}

}  // namespace frontier_surfels::replay
