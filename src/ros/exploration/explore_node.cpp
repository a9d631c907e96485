/// explore: a robot with a depth camera explores an unknown flat. An example of a planner: start from it. The robot looks around once.
/// Then, again and again, it takes views from which frontier can be seen: the viewpoints of ~clusters that it can reach through free space,
/// and views from where it stands. It asks ~evaluate_views what they show, and takes the view that shows the most frontier for its way. It
/// ends when no view shows enough. Other strategies are for comparison.
#include <frontier_surfels/Coverage.h>
#include <frontier_surfels/EvaluateViews.h>
#include <frontier_surfels/FrameReport.h>
#include <frontier_surfels/FrontierClusterArray.h>
#include <frontier_surfels/GetStateGrid.h>
#include <frontier_surfels/MapFile.h>
#include <frontier_surfels/MoveCamera.h>
#include <frontier_surfels/StatesUpdate.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <set>

#include "frontier_surfels/planner/map_client.hpp"
#include "frontier_surfels/planner/ways.hpp"
#include "ros/exploration/camera_poses.hpp"
#include "ros/exploration/exploration_log.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels {
namespace {

using Clock = std::chrono::steady_clock;
using Eigen::Vector3f;

/// Something to look at, from somewhere.
struct Candidate {
  Isometry T_world_camera;  ///< optical frame
  float length;             ///< of the way there [m]
  float value;              ///< frontier that is visible from there [m2]
};

class Explorer {
 public:
  /// @param strategy  frontiers; octomap: the same, but of OctoMap's voxels; nearest: the nearest viewpoint; random: any free view
  Explorer(const ros::NodeHandle& pnh, const std::string& strategy, ExplorationLog& log)
      : strategy_(strategy),
        most_views_(pnh.param("most_views", 600)),
        view_cost_(pnh.param("view_cost", 1.0)),
        least_value_(pnh.param("least_value", 0.05)),
        range_(pnh.param("range", 3.0)),
        ways_{0.2, pnh.param("radius", 0.22), pnh.param("lowest", 0.4), pnh.param("highest", 2.1), 0.9, {}},
        log_(log),
        random_(static_cast<unsigned>(pnh.param("seed", 1))) {
    ros::NodeHandle nh;
    const std::string map = strategy == "octomap" ? "octomap_frontiers" : "mapper", camera = "simulated_camera";
    start_again(map + "/reset");
    start_again(camera + "/reset");
    subscribers_ = {nh.subscribe(map + "/states_update", 1000, &Explorer::on_states, this),
                    nh.subscribe<FrontierClusterArray>(map + "/clusters", 10, [this](const auto& clusters) { clusters_ = *clusters; }),
                    nh.subscribe(map + "/report", 100, &Explorer::on_report, this),
                    nh.subscribe<Coverage>(camera + "/coverage", 100, [this](const auto& coverage) { coverage_ = *coverage; })};
    move_ = nh.serviceClient<MoveCamera>(camera + "/move");
    capture_ = nh.serviceClient<std_srvs::Trigger>(camera + "/capture");
    get_state_grid_ = nh.serviceClient<GetStateGrid>(map + "/get_state_grid");
    evaluate_views_ = nh.serviceClient<EvaluateViews>(map + "/evaluate_views");
    save_map_ = nh.serviceClient<MapFile>(map + "/save_map");
  }

  void run() {
    look_around();
    while (ros::ok() && coverage_.views < static_cast<unsigned>(most_views_)) {
      const Ways ways(map_.grid(), here(), ways_);
      const std::optional<Candidate> next = choose(ways);
      decision_ms_ = std::chrono::duration<double, std::milli>(Clock::now() - mapped_).count();
      if (!next) break;  // nothing that can be reached is left to be seen
      tried_.insert(key(next->T_world_camera));
      move(ways.way(next->T_world_camera.translation()), next->T_world_camera);
      ways_.been = {start_, here()};
    }
    save_map(true);
    ROS_INFO("Explored by %s: %u views, %.1f m, %.1f s; %.1f %% of what can be seen was seen.", strategy_.c_str(), coverage_.views,
             coverage_.metres, coverage_.seconds, 100 * coverage_.share);
  }

 private:
  // What the topics tell
  void on_states(const StatesUpdate::ConstPtr& update) {
    if (map_.apply(to_state_changes(*update))) return;
    GetStateGrid whole;
    if (get_state_grid_.call(whole)) map_.apply(to_state_changes(whole.response.grid));
  }
  void on_report(const FrameReport& report) {
    report_ = report;
    mapped_ = Clock::now();
  }

  /// Handles messages until the condition holds. @throws Error  it never did
  template <typename Condition>
  void wait(const char* what, Condition condition) {
    const auto end = Clock::now() + std::chrono::seconds(60);
    while (ros::ok() && !condition()) {
      if (Clock::now() > end) throw Error(std::string("Exploring has ended: waited 60 s for ") + what + ".");
      ros::spinOnce();
      ros::WallDuration(0.001).sleep();
    }
  }

  /// Waits until an image is mapped, and the planner's topics tell of it.
  void wait_for_map(const ros::Time& stamp) {
    wait("an image to be mapped", [&] { return report_.header.stamp == stamp; });
    if (report_.result != FrameReport::INTEGRATED) ROS_WARN("An image was not mapped: %s", report_.reason.c_str());
    wait("states and clusters", [&] { return map_.grid().sequence() >= report_.sequence && clusters_.sequence >= report_.sequence; });
    wait("the coverage", [&] { return coverage_.header.stamp >= stamp; });
    if (!ros::ok()) return;  // Ctrl-C: this view does not count
    log_.add(strategy_, coverage_, decision_ms_, here());
    save_map(false);
  }

  static void start_again(const std::string& service) {
    std_srvs::Trigger reset;
    if (!ros::service::waitForService(service, 60000) || !ros::service::call(service, reset) || !reset.response.success)
      throw Error("The service " + service + " does not answer: do mapper and camera run? " + reset.response.message);
  }

  Vector3f here() const { return T_world_camera_.translation(); }

  /// Moves along a way to a pose of the optical frame, where the camera takes an image.
  void move(const std::vector<Vector3f>& way, const Isometry& T_world_camera) {
    MoveCamera service;
    for (std::size_t n = 1; n + 1 < way.size(); ++n) service.request.via.push_back(messages::to_point(way[n]));
    service.request.goal.pose = to_pose(T_world_camera * T_body_camera().inverse());
    if (!move_.call(service) || service.response.stamp.isZero()) throw Error("The camera does not move. " + service.response.message);
    T_world_camera_ = messages::to_isometry(service.response.pose).cast<float>() * T_body_camera();
    wait_for_map(service.response.stamp);
  }

  /// The first views: all around.
  void look_around() {
    wait("camera and map", [&] {  // else the first messages are lost
      return std::all_of(subscribers_.begin(), subscribers_.end(), [](const ros::Subscriber& s) { return s.getNumPublishers() > 0; });
    });
    std_srvs::Trigger capture;
    auto next_time = Clock::now();
    wait("the first image to be mapped", [&] {  // again and again, because the mapper may not listen yet
      if (Clock::now() >= next_time && capture_.call(capture)) next_time = Clock::now() + std::chrono::seconds(5);
      return report_.result == FrameReport::INTEGRATED && !report_.header.stamp.isZero();
    });
    T_world_camera_ = messages::to_isometry(report_.pose).cast<float>();
    wait_for_map(report_.header.stamp);
    start_ = here();
    ways_.been = {start_};
    for (int n = 1; n < 8; ++n) {
      Isometry turned = T_world_camera_;
      turned.linear() = Eigen::AngleAxisf(M_PI / 4, Vector3f::UnitZ()) * T_world_camera_.linear();
      move({}, turned);
    }
  }

  /// Poses that are the same to a decimetre count as one.
  static std::array<long, 6> key(const Isometry& T) {
    const Vector3f p = 10 * T.translation(), z = 10 * T.linear().col(2);
    return {std::lround(p.x()), std::lround(p.y()), std::lround(p.z()), std::lround(z.x()), std::lround(z.y()), std::lround(z.z())};
  }

  std::optional<Candidate> choose(const Ways& ways) {
    if (strategy_ == "random") return random_view(ways);
    std::vector<Candidate> all = reachable_viewpoints(ways);
    const bool nearest = strategy_ == "nearest";
    const auto gain = [&](const Candidate& c) { return nearest ? -c.length : c.value / (static_cast<float>(view_cost_) + c.length); };
    const auto better = [&](const Candidate& a, const Candidate& b) { return gain(a) > gain(b); };
    if (!nearest) add_views_from_here(all);
    constexpr std::size_t kEvaluated = 50;
    std::stable_sort(all.begin(), all.end(), better);
    if (all.size() > kEvaluated) all.resize(kEvaluated);
    if (!nearest) evaluate(all);
    all.erase(std::remove_if(all.begin(), all.end(), [&](const Candidate& c) { return c.value < least_value_; }), all.end());
    const auto best = std::min_element(all.begin(), all.end(), better);
    return best == all.end() ? std::nullopt : std::make_optional(*best);
  }

  std::vector<Candidate> reachable_viewpoints(const Ways& ways) const {
    std::vector<Candidate> all;
    for (const FrontierCluster& cluster : clusters_.clusters)
      for (const Viewpoint& viewpoint : cluster.viewpoints) {
        const Isometry T = messages::to_isometry(viewpoint.pose).cast<float>();
        const float length = ways.length(T.translation());
        if (std::isfinite(length) && tried_.count(key(T)) == 0) all.push_back({T, length, viewpoint.value});
      }
    return all;
  }

  /// Views of clusters that are near and in sight: they need no way.
  void add_views_from_here(std::vector<Candidate>& all) const {
    constexpr float kNear = 0.3F, kSteepest = 0.8F, kNotFreeAtEnd = 0.1F;
    for (const FrontierCluster& cluster : clusters_.clusters) {
      const Vector3f centroid = messages::to_vector(cluster.centroid), way = centroid - here();
      const float distance = way.norm();
      const Vector3f normal = Eigen::Vector3d(cluster.normal.x, cluster.normal.y, cluster.normal.z).cast<float>();
      if (distance < kNear || distance > gaining_range() + 0.2F || std::abs(way.z()) > kSteepest * distance || normal.dot(way) > 0)
        continue;
      const Vector3f end = here() + way * (1 - kNotFreeAtEnd / distance);
      const Isometry T = looking_at(here(), centroid);
      if (tried_.count(key(T)) == 0 && map_.grid().ray_state({here(), end}, false).state != SpaceState::kOccupied)
        all.push_back({T, 0, cluster.area});
    }
  }

  /// Only nearer frontier counts: behind it there must be something that is within the camera's range.
  float gaining_range() const { return static_cast<float>(range_ * 2 / 3); }

  void evaluate(std::vector<Candidate>& all) {
    if (all.empty()) return;
    EvaluateViews service;
    service.request.width = 120;  // enough to compare views, and quick
    service.request.height = 90;
    service.request.fx = service.request.fy = 60 / std::tan(29 * M_PI / 180);  // 58 degrees, as a Kinect
    service.request.cx = 59.5;
    service.request.cy = 44.5;
    service.request.range = gaining_range();
    for (const Candidate& candidate : all) service.request.poses.push_back(to_pose(candidate.T_world_camera));
    if (!evaluate_views_.call(service)) throw Error("The map did not evaluate views.");
    for (std::size_t n = 0; n < all.size(); ++n) all[n].value = service.response.values[n].frontier_area;
  }

  std::optional<Candidate> random_view(const Ways& ways) {
    const std::vector<Vector3f> places = ways.places();
    if (places.empty()) return std::nullopt;
    const Vector3f eye = places[random_() % places.size()];
    const auto angle = [&](double most) { return static_cast<float>(most * (2.0 * random_() / std::mt19937::max() - 1)); };
    const float yaw = angle(M_PI), pitch = angle(M_PI / 4);
    const Vector3f forward(std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch), std::sin(pitch));
    return Candidate{looking_at(eye, eye + forward), 0, std::numeric_limits<float>::infinity()};
  }

  /// For the page's film strip.
  void save_map(bool at_end) {
    const std::optional<std::string> path = log_.picture(strategy_, coverage_, at_end);
    if (!path || strategy_ == "octomap") return;
    MapFile file;
    file.request.path = *path;
    if (!save_map_.call(file) || !file.response.success) ROS_WARN("The page lacks a picture. %s", file.response.message.c_str());
  }

  const std::string strategy_;
  const int most_views_;
  const double view_cost_, least_value_, range_;
  WayOptions ways_;
  ExplorationLog& log_;
  std::mt19937 random_;
  ros::ServiceClient move_, capture_, get_state_grid_, evaluate_views_, save_map_;
  MapClient map_;
  FrontierClusterArray clusters_;
  FrameReport report_;
  Coverage coverage_;
  Clock::time_point mapped_;  ///< when the last report came
  Isometry T_world_camera_ = Isometry::Identity();
  Vector3f start_ = Vector3f::Zero();
  std::set<std::array<long, 6>> tried_;  ///< views that were taken, or could not be
  double decision_ms_ = 0;
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace
}  // namespace frontier_surfels

int main(int argc, char** argv) {
  using namespace frontier_surfels;
  ros::init(argc, argv, "explore");
  const ros::NodeHandle nh, pnh("~");
  try {
    const std::vector<std::string> strategies = strategies_in(pnh.param<std::string>("strategies", "frontiers"));
    ExplorationLog log(pnh.param<std::string>("report", ""));
    int code = 0;
    try {
      for (const std::string& strategy : strategies)
        if (ros::ok()) Explorer(pnh, strategy, log).run();
    } catch (const std::exception& fault) {
      if (ros::ok()) {  // else it is Ctrl-C that services fail from
        ROS_FATAL("%s", fault.what());
        code = 1;
      }
    }
    log.finish();  // what was done is kept
    return code;
  } catch (const std::exception& fault) {
    ROS_FATAL("%s", fault.what());
    return 1;
  }
}
