#include "ros/services/planner_services.hpp"

#include <ros/console.h>

#include <future>
#include <string>
#include <utility>
#include <vector>

#include "frontier_surfels/paths.hpp"
#include "ros/input/conversions.hpp"
#include "ros/output/octomap_bridge.hpp"
#include "ros/output/planner_messages.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kMostPoints = 20'000'000;  // of a request: roscpp refuses messages above 1 GB
constexpr std::size_t kMostViews = 100'000;

std::vector<Eigen::Vector3f> to_vectors(const std::vector<geometry_msgs::Point>& points) {
  std::vector<Eigen::Vector3f> vectors;
  vectors.reserve(points.size());
  for (const geometry_msgs::Point& p : points) vectors.push_back(messages::to_vector(p));
  return vectors;
}

Eigen::Vector3f to_vector(const geometry_msgs::Vector3& v) { return Eigen::Vector3d(v.x, v.y, v.z).cast<float>(); }

void check_count(const char* field, std::size_t count, std::size_t most) {
  if (count == 0) throw Error(std::string("The request has no ") + field + ".");
  if (count > most)
    throw Error("The request has " + std::to_string(count) + " " + field + ", more than " + std::to_string(most) + ": divide it.");
}

std::vector<Eigen::AlignedBox3f> boxes_around(const std::vector<Eigen::Vector3f>& centres, const Eigen::Vector3f& size) {
  std::vector<Eigen::AlignedBox3f> boxes;
  boxes.reserve(centres.size());
  for (const Eigen::Vector3f& centre : centres) boxes.emplace_back(centre - size / 2, centre + size / 2);
  return boxes;
}

/// Runs the job between two frames. @return false if the mapper is shutting down
template <typename Job>
bool ask(Worker& worker, Job job) {
  try {
    worker.run_job(std::move(job));
  } catch (const std::future_error&) {
    return false;
  }
  return true;
}

std::vector<std::uint8_t> to_bytes(const std::vector<SpaceState>& states) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(states.size());
  for (const SpaceState state : states) bytes.push_back(static_cast<std::uint8_t>(state));
  return bytes;
}

}  // namespace

PlannerServices::PlannerServices(ServiceThread& thread, const NodeConfig& config, Mapper& mapper, Worker& worker,
                                 PlannerPublisher& publisher, std::function<void()> refresh)
    : config_(config), mapper_(mapper), worker_(worker), publisher_(publisher), refresh_(std::move(refresh)) {
  thread.serve<GetStates>("get_states", &PlannerServices::get_states, this);
  thread.serve<CastRays>("cast_rays", &PlannerServices::cast_rays, this);
  thread.serve<EvaluateViews>("evaluate_views", &PlannerServices::evaluate_views, this);
  thread.serve<GetStateGrid>("get_state_grid", &PlannerServices::get_state_grid, this);
  thread.serve<MapFile>("save_octomap", &PlannerServices::save_octomap, this);
}

bool PlannerServices::get_states(GetStates::Request& request, GetStates::Response& response) {
  check_count("points", request.points.size(), kMostPoints);
  const std::vector<Eigen::Vector3f> points = to_vectors(request.points);
  const Eigen::Vector3f box_size = to_vector(request.box_size);
  return ask(worker_, [&] {
    response.sequence = mapper_.sequence();
    response.states = to_bytes(box_size.isZero(0) ? mapper_.states(points) : mapper_.box_states(boxes_around(points, box_size)));
    if (request.reach == 0) return;
    for (const NearestBoundary& boundary : mapper_.nearest_boundaries(points, request.reach)) {
      response.distances.push_back(boundary.distance);
      response.in_front.push_back(boundary.in_front ? 1 : 0);
      response.frontier.push_back(boundary.label == Label::kFrontier ? 1 : 0);
    }
    response.clearance = mapper_.clearance(points, request.reach);
  });
}

bool PlannerServices::cast_rays(CastRays::Request& request, CastRays::Response& response) {
  check_count("starts", request.starts.size(), kMostPoints);
  if (request.starts.size() != request.ends.size())
    throw Error("The request has " + std::to_string(request.starts.size()) + " starts and " + std::to_string(request.ends.size()) +
                " ends: each ray needs both.");
  std::vector<Ray> rays;
  for (std::size_t n = 0; n < request.starts.size(); ++n)
    rays.push_back({messages::to_vector(request.starts[n]), messages::to_vector(request.ends[n])});
  const Eigen::Vector3f box_size = to_vector(request.box_size);
  const bool boxes = !box_size.isZero(0);
  const double step = request.step != 0 ? request.step : boxes ? 0.05 : 0.01;
  return ask(worker_, [&] {
    response.sequence = mapper_.sequence();
    const bool stop = request.stop_at_unknown;
    for (const RayState& ray : boxes ? mapper_.path_states(rays, box_size, stop, step) : mapper_.ray_states(rays, stop, step)) {
      response.states.push_back(static_cast<std::uint8_t>(ray.state));
      response.distances.push_back(ray.distance);
    }
  });
}

bool PlannerServices::evaluate_views(EvaluateViews::Request& request, EvaluateViews::Response& response) {
  check_count("poses", request.poses.size(), kMostViews);
  const ViewQuestion question = messages::to_question(request);
  return ask(worker_, [&] {
    response.sequence = mapper_.sequence();
    for (const ViewValue& value : mapper_.evaluate_views(question)) response.values.push_back(messages::to_message(value));
  });
}

/// The grid as subscribers of ~states_update have it after their next message, so that its number fits that.
bool PlannerServices::get_state_grid(GetStateGrid::Request&, GetStateGrid::Response& response) {
  if (!ask(worker_, refresh_)) return false;
  response.grid = messages::to_message(publisher_.whole_grid());
  response.grid.header.frame_id = config_.world_frame;
  response.grid.header.stamp = ros::Time::now();
  return true;
}

bool PlannerServices::save_octomap(MapFile::Request& request, MapFile::Response& response) {
  return answer(response, [&] {
    if (request.path.empty()) throw FileError("No path was given: give the path of the file to be written, which ends in .bt.");
    worker_.run_job(refresh_);
    const std::string path = absolute_path(request.path);
    OctomapBridge octomap(config_.planner_resolution);
    octomap.apply(publisher_.whole_grid());
    octomap.save(path);
    const std::string done = "The octree was written to " + path + ".";
    ROS_INFO("%s", done.c_str());
    return done;
  });
}

}  // namespace frontier_surfels
