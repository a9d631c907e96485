/// octomap_frontiers: an OctoMap with the topics and services that planners follow the mapper by, so that the same planner can be compared
/// on both. Its frontier voxels and occupied voxels become surfels; states are the tree's.
#include <frontier_surfels/EvaluateViews.h>
#include <frontier_surfels/FrameReport.h>
#include <frontier_surfels/GetStateGrid.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>

#include <memory>

#include "frontier_surfels/mapper.hpp"
#include "frontier_surfels/scoring/octomap_truth.hpp"
#include "ros/arguments.hpp"
#include "ros/input/camera_input.hpp"
#include "ros/output/planner_messages.hpp"
#include "ros/output/planner_publisher.hpp"
#include "ros/services/service_thread.hpp"
#include "ros/worker.hpp"

namespace frontier_surfels {
namespace {

constexpr char kHelp[] =
    R"(An OctoMap that planners can follow like the mapper, for comparison. It takes the mapper's parameters, and maps while somebody listens.

usage: rosrun frontier_surfels octomap_frontiers [TOPIC:=OTHER_TOPIC ...] [_PARAMETER:=VALUE ...]

subscribes  depth/image, depth/camera_info, tf
publishes   ~report, ~states_update, ~clusters, ~cluster_markers, ~projected_map: of voxels of ~planner_resolution
services    ~reset, ~get_state_grid, ~evaluate_views

)";

NodeConfig parameters(const ros::NodeHandle& pnh) {
  NodeConfig config = read_parameters(pnh, nullptr);
  config.mapper.map_folder.clear();
  return config;
}

class OctomapFrontiers {
 public:
  OctomapFrontiers(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~OctomapFrontiers() { worker_.stop(); }

 private:
  void start_again();
  void report_dropped(const DroppedImage& image);
  bool map_next();
  void map(const CompleteImage& image);
  void push();
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool get_state_grid(GetStateGrid::Request&, GetStateGrid::Response& response);
  bool evaluate_views(EvaluateViews::Request& request, EvaluateViews::Response& response);

  ros::NodeHandle nh_, pnh_;
  const NodeConfig config_;
  FramePoses poses_;
  ros::Publisher reports_;

  // Only used by the worker's thread
  std::unique_ptr<scoring::OctomapTruth> tree_;
  std::vector<Surfel> boundary_;  ///< of the tree
  Mapper views_;                  ///< has the same surfels, and draws them
  std::uint64_t sequence_ = 1, drawn_ = 0;
  bool is_new_ = true;  ///< nothing of this tree was pushed yet
  ros::Time stamp_;

  Worker worker_;
  PlannerPublisher publisher_;
  CameraInput camera_;
  ServiceThread services_;
};

OctomapFrontiers::OctomapFrontiers(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh),
      pnh_(pnh),
      config_(parameters(pnh)),
      poses_(config_.world_frame),
      reports_(pnh_.advertise<FrameReport>("report", 100)),
      views_(config_.mapper),
      worker_([this] { return map_next(); },
              [this] {
                if (publisher_.wants_changes() && publisher_.sequence() != sequence_) push();
              }),
      publisher_(pnh_, config_, [this] { worker_.wake(); }),
      camera_(config_, {"depth/image", "depth/camera_info", ""}, poses_,
              {[this] { worker_.wake(); }, [this](const DroppedImage& image) { report_dropped(image); }}),
      services_(pnh_) {
  start_again();
  poses_.start(nh_);
  camera_.start(nh_, pnh_);
  worker_.start();
  services_.serve<std_srvs::Trigger>("reset", &OctomapFrontiers::reset, this);
  services_.serve<GetStateGrid>("get_state_grid", &OctomapFrontiers::get_state_grid, this);
  services_.serve<EvaluateViews>("evaluate_views", &OctomapFrontiers::evaluate_views, this);
  services_.start();
}

void OctomapFrontiers::start_again() {
  tree_ = std::make_unique<scoring::OctomapTruth>(config_.planner_resolution, config_.mapper);
  boundary_.clear();
  is_new_ = true;
  ++sequence_;
}

/// A planner waits for the report on its image. From any thread.
void OctomapFrontiers::report_dropped(const DroppedImage& image) {
  FrameReport report;
  report.header = image.arrival.image.header();
  report.result = image.result;
  report.reason = image.reason;
  reports_.publish(report);
}

bool OctomapFrontiers::map_next() {
  const std::optional<CompleteImage> image = camera_.take();
  if (!image) return false;
  if (reports_.getNumSubscribers() > 0) map(*image);
  return true;
}

void OctomapFrontiers::map(const CompleteImage& image) {
  FrameReport report;
  report.header = image.arrival.image.header();
  try {
    tree_->add(CameraFrame(image).view());
    boundary_ = tree_->boundary();
    // A voxel is unknown as a whole: known space ends at its face, half an edge before its centre.
    for (Surfel& surfel : boundary_) surfel.position += static_cast<float>(config_.planner_resolution / 2) * surfel.normal;
    stamp_ = report.header.stamp;
    ++sequence_;
    report.result = FrameReport::INTEGRATED;
  } catch (const std::exception& fault) {
    report.result = FrameReport::DROPPED_BAD_IMAGE;
    report.reason = fault.what();
  }
  report.pose = messages::to_pose(image.T_world_camera);
  report.sequence = sequence_;
  report.surfels = static_cast<std::uint32_t>(boundary_.size());
  reports_.publish(report);
}

/// The whole tree, each time.
void OctomapFrontiers::push() {
  StateChanges states = tree_->states(sequence_);
  if (!is_new_) states.since = publisher_.sequence();
  is_new_ = false;
  Changes surfels;
  surfels.sequence = sequence_;
  surfels.updated = boundary_;
  publisher_.push(std::move(states), std::move(surfels), stamp_);
}

bool OctomapFrontiers::reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer(response, [&] {
    worker_.run_job([this] {
      start_again();
      camera_.reset();
    });
    return "The tree is empty.";
  });
}

bool OctomapFrontiers::get_state_grid(GetStateGrid::Request&, GetStateGrid::Response& response) {
  worker_.run_job([this] { push(); });
  response.grid = messages::to_message(publisher_.whole_grid());
  response.grid.header.frame_id = config_.world_frame;
  response.grid.header.stamp = ros::Time::now();
  return true;
}

bool OctomapFrontiers::evaluate_views(EvaluateViews::Request& request, EvaluateViews::Response& response) {
  const ViewQuestion question = messages::to_question(request);
  worker_.run_job([&] {
    if (drawn_ != sequence_) views_.load(boundary_);
    drawn_ = sequence_;
    for (const ViewValue& value : views_.evaluate_views(question)) response.values.push_back(messages::to_message(value));
    response.sequence = sequence_;
  });
  return true;
}

}  // namespace
}  // namespace frontier_surfels

int main(int argc, char** argv) {
  using namespace frontier_surfels;
  if (const auto code = answer_arguments(argc, argv, "octomap_frontiers", [] { return std::string(kHelp); })) return *code;
  ros::init(argc, argv, "octomap_frontiers");
  const ros::NodeHandle nh, pnh("~");
  try {
    OctomapFrontiers map(nh, pnh);
    ros::spin();
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
}
