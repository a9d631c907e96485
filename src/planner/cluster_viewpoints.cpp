#include "planner/cluster_viewpoints.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace frontier_surfels {
namespace {

constexpr float kDegree = 3.14159265358979F / 180;
constexpr float kApart = 0.3F;  // [m] between two viewpoints
constexpr std::size_t kMost = 3;
constexpr float kCounted = 2;                      // clearance is told up to this times the one asked for
constexpr float kSteepest = 35 * kDegree;          // of the way from the centroid to a viewpoint
constexpr float kNotFreeAtEnd = 2;                 // [cell] a frontier borders on the unknown, so the last bit of a ray need not be free
const float kRight = std::tan(58 * kDegree / 2);   // x / z at the edge of the image
const float kBottom = std::tan(45 * kDegree / 2);  // y / z

Eigen::Isometry3f look_at(const Eigen::Vector3f& eye, const Eigen::Vector3f& target) {
  const Eigen::Vector3f z = (target - eye).normalized(), x = z.cross(Eigen::Vector3f::UnitZ()).normalized();
  Eigen::Isometry3f pose = Eigen::Isometry3f::Identity();
  pose.linear() << x, z.cross(x), z;
  pose.translation() = eye;
  return pose;
}

/// Points of the cluster that lie in the image, and show their known side.
std::vector<const ClusterPoint*> facing(const Cluster& cluster, const Eigen::Isometry3f& T_world_camera) {
  std::vector<const ClusterPoint*> points;
  const Eigen::Isometry3f T_camera_world = T_world_camera.inverse();
  for (const ClusterPoint& point : cluster.points) {
    const Eigen::Vector3f p = T_camera_world * point.position;
    const bool in_image = p.z() > 0 && std::abs(p.x()) <= kRight * p.z() && std::abs(p.y()) <= kBottom * p.z();
    if (in_image && point.normal.dot(T_world_camera.translation() - point.position) > 0) points.push_back(&point);
  }
  return points;
}

float visible_area(const Cluster& cluster, const Eigen::Isometry3f& T_world_camera, const ClusterConfig& config, const Space& space) {
  const Eigen::Vector3f eye = T_world_camera.translation();
  std::size_t seen = 0;
  for (const ClusterPoint* point : facing(cluster, T_world_camera)) {
    const Eigen::Vector3f way = point->position - eye;
    const float length = way.norm(), end = length - kNotFreeAtEnd * static_cast<float>(config.cell);
    seen += end <= 0 || space.sees(eye, eye + way * (end / length));
  }
  return cluster.area * static_cast<float>(seen) / static_cast<float>(cluster.points.size());
}

/// Clearance of a viewpoint, counted up to `most` [m]; none if it is too small.
std::optional<float> clearance_at(const Eigen::Vector3f& eye, float most, const ClusterConfig& config, const Space& space) {
  if (!space.is_free(eye)) return {};
  const float found = space.clearance(eye, most);
  return found >= static_cast<float>(config.clearance) ? std::optional<float>(found) : std::nullopt;
}

/// Unit vectors from the centroid to where a viewpoint may stand.
std::vector<Eigen::Vector3f> directions(const Cluster& cluster) {
  const Eigen::Vector3f& normal = cluster.normal;
  const float level = normal.head<2>().norm();
  const float azimuth = level > 1e-3F ? std::atan2(normal.y(), normal.x()) : 0;
  const float steepest = std::clamp(std::atan2(normal.z(), level), -kSteepest, kSteepest);
  // One that faces up or down is seen as well from all around.
  const int turns = level > 0.5F ? 3 : 6;
  std::vector<float> elevations = {steepest};
  if (std::abs(steepest) > 10 * kDegree) elevations.push_back(0);

  std::vector<Eigen::Vector3f> all;
  for (const float elevation : elevations)
    for (int turn = 0; turn <= turns; ++turn)
      for (const int side : {1, -1}) {
        if (side < 0 && (turn == 0 || turn == 6)) continue;
        const float angle = azimuth + static_cast<float>(side * turn) * 30 * kDegree;
        all.emplace_back(std::cos(angle) * std::cos(elevation), std::sin(angle) * std::cos(elevation), std::sin(elevation));
      }
  return all;
}

/// Viewpoints that are in the clear, with the area that they would see if nothing stood in the way.
std::vector<ClusterViewpoint> candidates(const Cluster& cluster, const ClusterConfig& config, const Space& space) {
  const float needed = static_cast<float>(config.clearance);
  std::vector<ClusterViewpoint> all;
  for (const float factor : {1.0F, 0.75F, 1.4F})
    for (const Eigen::Vector3f& direction : directions(cluster)) {
      const Eigen::Vector3f eye = cluster.centroid + factor * static_cast<float>(config.view_distance) * direction;
      if (!space.is_free(eye)) continue;  // the cheapest test, which most places fail
      const Eigen::Isometry3f pose = look_at(eye, cluster.centroid);
      const float share = static_cast<float>(facing(cluster, pose).size()) / static_cast<float>(cluster.points.size());
      if (share == 0) continue;
      if (const auto clearance = clearance_at(eye, needed, config, space)) all.push_back({pose, cluster.area * share, *clearance});
    }
  return all;
}

bool sees_more(const ClusterViewpoint& a, const ClusterViewpoint& b) { return a.value > b.value; }

}  // namespace

std::vector<ClusterViewpoint> find_viewpoints(const Cluster& cluster, const ClusterConfig& config, const Space& space) {
  std::vector<ClusterViewpoint> open = candidates(cluster, config, space), best;
  std::vector<bool> exact(open.size(), false);
  const auto apart_from_best = [&](const ClusterViewpoint& view) {
    return std::all_of(best.begin(), best.end(), [&](const ClusterViewpoint& other) {
      return (view.T_world_camera.translation() - other.T_world_camera.translation()).norm() >= kApart;
    });
  };
  // Rays are the costly part: they are only followed from the candidate that promises most. If it keeps its promise, it is the best.
  while (best.size() < kMost) {
    std::size_t first = open.size();
    for (std::size_t n = 0; n < open.size(); ++n)
      if (open[n].value > 0 && (first == open.size() || sees_more(open[n], open[first])) && apart_from_best(open[n])) first = n;
    if (first == open.size()) break;
    if (!exact[first]) {
      open[first].value = visible_area(cluster, open[first].T_world_camera, config, space);
      exact[first] = true;
      continue;
    }
    best.push_back(open[first]);
    best.back().clearance = space.clearance(open[first].T_world_camera.translation(), kCounted * static_cast<float>(config.clearance));
    open[first].value = 0;
  }
  return best;
}

std::vector<ClusterViewpoint> still_clear(const Cluster& cluster, const ClusterConfig& config, const Space& space) {
  const float most = kCounted * static_cast<float>(config.clearance);
  std::vector<ClusterViewpoint> clear;
  for (const ClusterViewpoint& view : cluster.viewpoints)
    if (const auto clearance = clearance_at(view.T_world_camera.translation(), most, config, space))
      clear.push_back({view.T_world_camera, view.value, *clearance});
  return clear;
}

std::vector<ClusterViewpoint> valued(const Cluster& cluster, const ClusterConfig& config, const Space& space) {
  std::vector<ClusterViewpoint> all;
  for (ClusterViewpoint view : cluster.viewpoints) {
    view.value = visible_area(cluster, view.T_world_camera, config, space);
    if (view.value > 0) all.push_back(view);
  }
  std::stable_sort(all.begin(), all.end(), sees_more);
  return all;
}

}  // namespace frontier_surfels
