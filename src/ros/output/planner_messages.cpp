#include "ros/output/planner_messages.hpp"

#include <cmath>
#include <string>

#include "ros/input/conversions.hpp"

namespace frontier_surfels::messages {
namespace {

geometry_msgs::Point32 to_point32(const Eigen::Vector3f& v) {
  geometry_msgs::Point32 point;
  point.x = v.x();
  point.y = v.y();
  point.z = v.z();
  return point;
}

Eigen::Isometry3d to_isometry(const geometry_msgs::Pose& pose, std::size_t number) {
  const Eigen::Quaterniond q(pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z);
  if (!(std::abs(q.norm() - 1) < 1e-2))
    throw Error("The quaternion of poses[" + std::to_string(number) + "] is not of unit length: it is no orientation.");
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translate(Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z)).rotate(q.normalized());
  return T;
}

}  // namespace

StatesUpdate to_message(const StateChanges& changes) {
  StatesUpdate message;
  message.sequence = changes.sequence;
  message.since = changes.since;
  message.resolution = changes.resolution;
  for (const StateBlock& block : changes.blocks) {
    message.blocks.insert(message.blocks.end(), block.block.begin(), block.block.end());
    const bool mixed = block.cells.size() > 1;
    message.kinds.push_back(mixed ? static_cast<std::uint8_t>(StatesUpdate::MIXED) : block.cells.front());
    if (mixed) message.cells.insert(message.cells.end(), block.cells.begin(), block.cells.end());
  }
  return message;
}

FrontierCluster to_message(const Cluster& cluster) {
  FrontierCluster message;
  message.id = cluster.id;
  message.centroid = to_point(cluster.centroid);
  message.normal.x = cluster.normal.x();
  message.normal.y = cluster.normal.y();
  message.normal.z = cluster.normal.z();
  message.area = cluster.area;
  message.box_min = to_point(cluster.box.min());
  message.box_max = to_point(cluster.box.max());
  message.surfels = static_cast<std::uint32_t>(cluster.surfels);
  for (const ClusterPoint& point : cluster.points) {
    message.points.push_back(to_point32(point.position));
    message.normals.push_back(to_point32(point.normal));
  }
  message.touches_occupied = cluster.touches_occupied ? 1 : 0;
  for (const frontier_surfels::ClusterViewpoint& viewpoint : cluster.viewpoints) {
    message.viewpoints.emplace_back();
    message.viewpoints.back().pose = to_pose(viewpoint.T_world_camera.cast<double>());
    message.viewpoints.back().value = viewpoint.value;
    message.viewpoints.back().clearance = viewpoint.clearance;
  }
  return message;
}

ViewValueMessage to_message(const ViewValue& value) {
  ViewValueMessage message;
  message.frontier_area = value.frontier_area;
  message.occupied_area = value.occupied_area;
  message.frontier_pixels = value.frontier_pixels;
  message.occupied_pixels = value.occupied_pixels;
  message.beyond_range_pixels = value.beyond_range_pixels;
  message.state = static_cast<std::uint8_t>(value.state);
  message.clearance = value.clearance;
  return message;
}

ViewQuestion to_question(const EvaluateViewsRequest& request) {
  ViewQuestion question;
  for (const geometry_msgs::Pose& pose : request.poses)
    question.T_world_camera.push_back(to_isometry(pose, question.T_world_camera.size()));
  question.intrinsics = {request.fx, request.fy, request.cx, request.cy, 0, 0};
  if (request.width > 100000 || request.height > 100000)
    throw Error("The image of " + std::to_string(request.width) + " x " + std::to_string(request.height) + " pixels is too large.");
  question.intrinsics.width = static_cast<int>(request.width);
  question.intrinsics.height = static_cast<int>(request.height);
  question.min_range = request.min_range;
  question.range = request.range;
  const Eigen::Vector3f low = to_vector(request.box_min), high = to_vector(request.box_max);
  if (low != high) question.box_world = Eigen::AlignedBox3f(low, high);
  question.most_clearance = request.most_clearance != 0 ? request.most_clearance : 1;
  return question;
}

nav_msgs::OccupancyGrid projected(const StateGrid& grid, double min_z, double max_z) {
  constexpr int kEdge = StateBlock::kEdge;
  nav_msgs::OccupancyGrid map;
  const auto [low, high] = grid.extent();
  const double resolution = grid.resolution();
  map.info.resolution = static_cast<float>(resolution);
  map.info.origin.orientation.w = 1;
  if (high[0] < low[0]) return map;
  map.info.width = static_cast<std::uint32_t>((high[0] - low[0] + 1) * kEdge);
  map.info.height = static_cast<std::uint32_t>((high[1] - low[1] + 1) * kEdge);
  map.info.origin.position.x = low[0] * kEdge * resolution;
  map.info.origin.position.y = low[1] * kEdge * resolution;
  map.data.assign(static_cast<std::size_t>(map.info.width) * map.info.height, -1);
  // Heights beyond the grid are unknown.
  const double begin = std::max(min_z, low[2] * kEdge * resolution), end = std::min(max_z, (high[2] + 1) * kEdge * resolution);
  for (double z = (std::floor(begin / resolution) + 0.5) * resolution; z < end; z += resolution)
    for (std::size_t n = 0; n < map.data.size(); ++n) {
      if (map.data[n] == 100) continue;
      const auto x = static_cast<double>(n % map.info.width), y = static_cast<double>(n / map.info.width);
      const Eigen::Vector3d p(map.info.origin.position.x + (x + 0.5) * resolution, map.info.origin.position.y + (y + 0.5) * resolution, z);
      const SpaceState state = grid.state(p.cast<float>());
      if (state != SpaceState::kUnknown) map.data[n] = state == SpaceState::kOccupied ? 100 : 0;
    }
  return map;
}

}  // namespace frontier_surfels::messages
