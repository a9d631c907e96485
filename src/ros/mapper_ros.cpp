#include "ros/mapper_ros.hpp"

#include <frontier_surfels/FrameReport.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/publisher.h>

#include <algorithm>
#include <atomic>
#include <iostream>
#include <utility>

#include "frontier_surfels/mapper.hpp"
#include "frontier_surfels/number_text.hpp"
#include "ros/input/camera_input.hpp"
#include "ros/input/input_watch.hpp"
#include "ros/input/warning_throttle.hpp"
#include "ros/map_folder_watch.hpp"
#include "ros/output/map_publisher.hpp"
#include "ros/output/mapper_diagnostics.hpp"
#include "ros/output/planner_publisher.hpp"
#include "ros/output/surfel_messages.hpp"
#include "ros/services/map_services.hpp"
#include "ros/services/planner_services.hpp"
#include "ros/services/service_thread.hpp"
#include "ros/worker.hpp"

namespace frontier_surfels {
namespace {

double ms_since(Clock::time_point start) { return std::chrono::duration<double, std::milli>(Clock::now() - start).count(); }

NodeConfig read_and_warn(const ros::NodeHandle& pnh) {
  std::vector<std::string> warnings;
  NodeConfig config = read_parameters(pnh, &warnings);
  for (const std::string& warning : warnings) ROS_WARN("%s", warning.c_str());
  return config;
}

/// The cameras of a mapper.
const CameraTopics kCameras[] = {{"depth/image", "depth/camera_info", "color/image"}};

/// The topics of all depth images, for people.
std::string depth_topics(const ros::NodeHandle& nh) {
  std::string topics;
  for (const CameraTopics& camera : kCameras) topics += (topics.empty() ? "" : ", ") + nh.resolveName(camera.depth);
  return topics;
}

}  // namespace

class MapperRos::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~Impl();
  void stop();

 private:
  void tell_parameters();
  void report_dropped(const DroppedImage& image);
  void report_missing(const std::string& reason);
  void pause(bool paused);

  // On the mapping thread
  bool map_next();
  void map(CameraInput& camera, const CompleteImage& image);
  FrameReport integrate(CameraInput& camera, const CompleteImage& image);
  void start_again(const ros::Time& from, const ros::Time& to);
  void show_other_map();
  void reset_cameras();
  void publish_changes();
  void publish_to_planners();
  void push_to_planners();
  void after_work();

  ros::NodeHandle nh_, pnh_;
  const NodeConfig config_;
  Mapper mapper_;                                               // only used by the mapping thread
  MapFolderWatch folder_watch_{mapper_};                        // only used by the mapping thread
  MapState state_;                                              // only used by the mapping thread
  WarningThrottle publishing_faults_{std::chrono::seconds(5)};  // only used by the mapping thread
  FramePoses poses_;
  std::atomic<std::uint32_t> surfels_{0};  ///< in the map, for reports of frames that are not mapped
  std::atomic<std::uint64_t> sequence_{0};

  ros::Publisher reports_;
  std::unique_ptr<MapPublisher> publisher_;
  std::unique_ptr<PlannerPublisher> planner_publisher_;
  std::unique_ptr<Worker> worker_;
  std::vector<std::unique_ptr<CameraInput>> cameras_;
  std::unique_ptr<MapperDiagnostics> diagnostics_;
  std::unique_ptr<InputWatch> watch_;
  std::unique_ptr<ServiceThread> services_;
  std::unique_ptr<MapServices> map_services_;
  std::unique_ptr<PlannerServices> planner_services_;
  ros::WallTimer folder_timer_;
  bool stopped_ = false;
};

MapperRos::Impl::Impl(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh), pnh_(pnh), config_(read_and_warn(pnh)), mapper_(config_.mapper), poses_(config_.world_frame) {
  mapper_.prepare_questions();  // a planner's first question must not hold up the mapping of a robot that moves
  reports_ = pnh_.advertise<FrameReport>("report", 100);
  worker_ = std::make_unique<Worker>([this] { return map_next(); }, [this] { after_work(); });
  publisher_ = std::make_unique<MapPublisher>(pnh_, config_, [this] { worker_->wake(); });
  planner_publisher_ = std::make_unique<PlannerPublisher>(pnh_, config_, [this] { worker_->wake(); });
  const CameraInput::Listener listener = {[this] { worker_->wake(); }, [this](const DroppedImage& image) { report_dropped(image); }};
  for (const CameraTopics& topics : kCameras) cameras_.push_back(std::make_unique<CameraInput>(config_, topics, poses_, listener));
  diagnostics_ = std::make_unique<MapperDiagnostics>(nh_, pnh_, mapper_.device(), depth_topics(nh_));
  diagnostics_->set_map(mapper_.statistics(), mapper_.size_on_disk());
  tell_parameters();
  poses_.start(nh_);
  for (const auto& camera : cameras_) camera->start(nh_, pnh_);
  watch_ = std::make_unique<InputWatch>(nh_, cameras_, [this](const std::string& reason) { report_missing(reason); });
  worker_->start();
  if (!config_.mapper.map_folder.empty())  // looked at also while no images come
    folder_timer_ = nh_.createWallTimer(ros::WallDuration(1), [this](const ros::WallTimerEvent&) { worker_->wake(); });
  services_ = std::make_unique<ServiceThread>(pnh_);
  map_services_ = std::make_unique<MapServices>(
      *services_, config_, mapper_, *worker_,
      MapServices::Hooks{[this] { show_other_map(); }, [this] { reset_cameras(); }, [this](bool paused) { pause(paused); }});
  planner_services_ =
      std::make_unique<PlannerServices>(*services_, config_, mapper_, *worker_, *planner_publisher_, [this] { push_to_planners(); });
  services_->start();
  ROS_INFO("Device: %s (%s)", mapper_.device().c_str(), mapper_.device_choice().c_str());
  ROS_INFO("Mapping %s in the frame %s.", depth_topics(nh_).c_str(), config_.world_frame.c_str());
}

void MapperRos::Impl::tell_parameters() {
  NodeConfig in_force = config_;
  in_force.mapper = mapper_.config();
  write_parameters(pnh_, in_force);
  const std::string& folder = in_force.mapper.map_folder;
  if (!folder.empty()) ROS_INFO("The map is kept in the folder %s.", folder.c_str());
}

MapperRos::Impl::~Impl() {
  try {
    stop();
  } catch (const std::exception& fault) {
    ROS_ERROR("%s", fault.what());
    if (!ros::ok()) std::cerr << "[ERROR] " << fault.what() << std::endl;  // ROS_ERROR prints nothing after the shutdown
  }
}

void MapperRos::Impl::stop() {
  if (std::exchange(stopped_, true)) return;
  folder_timer_.stop();
  watch_.reset();
  worker_->stop();  // before the cameras, because it asks them
  cameras_.clear();
  services_->stop();
  publisher_.reset();
  planner_publisher_.reset();
  try {
    mapper_.flush();
  } catch (const std::exception& fault) {
    throw FileError(std::string("The end of the map is lost. ") + fault.what());
  }
}

void MapperRos::Impl::report_dropped(const DroppedImage& image) {
  FrameReport message;
  message.header = image.arrival.image.header();
  message.result = image.result;
  message.reason = image.reason;
  message.surfels = surfels_;
  message.sequence = sequence_;
  message.latency_ms = message.wait_ms = ms_since(image.arrival.time);
  reports_.publish(message);
  diagnostics_->add(message);
}

void MapperRos::Impl::report_missing(const std::string& reason) {
  FrameReport message;
  message.result = FrameReport::NO_INPUT;
  message.reason = reason;
  message.surfels = surfels_;
  message.sequence = sequence_;
  reports_.publish(message);
  ROS_WARN("%s", reason.c_str());
}

/// Maps the earliest image that is ready, of whichever camera. @return false if there is none
bool MapperRos::Impl::map_next() {
  CameraInput* next = nullptr;
  std::optional<ros::Time> earliest;
  for (const auto& camera : cameras_) {
    const std::optional<ros::Time> stamp = camera->next_stamp();
    if (!stamp || (earliest && *stamp >= *earliest)) continue;
    next = camera.get();
    earliest = stamp;
  }
  if (next == nullptr) return false;
  if (const std::optional<CompleteImage> image = next->take()) map(*next, *image);
  return true;
}

void MapperRos::Impl::map(CameraInput& camera, const CompleteImage& image) {
  const auto drop = [&](std::uint8_t result, const std::string& reason) { report_dropped({image.arrival, result, reason}); };
  try {
    const FrameReport message = integrate(camera, image);
    reports_.publish(message);
    diagnostics_->add(message);
    Statistics map;
    map.surfels = message.surfels;
    map.map_bytes = message.map_bytes;
    map.seen_bytes = message.seen_bytes;
    map.device_bytes = message.device_bytes;
    diagnostics_->set_map(map, mapper_.size_on_disk());
  } catch (const DroppedFrame& fault) {
    drop(fault.result, fault.what());
  } catch (const BadFrame& fault) {
    drop(FrameReport::DROPPED_BAD_IMAGE, fault.what());
  } catch (const std::exception& fault) {
    drop(FrameReport::FAILED, fault.what());
  }
}

FrameReport MapperRos::Impl::integrate(CameraInput& camera, const CompleteImage& image) {
  const std_msgs::Header& header = image.arrival.image.header();
  const CameraFrame pixels(image);
  const DepthFrame frame = pixels.view();
  // The camera lets an earlier stamp through only if time has jumped back.
  if (header.stamp < camera.last_mapped()) start_again(camera.last_mapped(), header.stamp);
  camera.set_last_mapped(header.stamp);
  const double wait_ms = ms_since(image.arrival.time);
  const Report report = mapper_.integrate(frame);
  surfels_ = static_cast<std::uint32_t>(report.surfels);
  sequence_ = report.sequence;
  state_ = {header.stamp, CameraView{report.T_world_camera, frame.intrinsics, config_.mapper.z_max}};

  FrameReport message = messages::to_message(report);
  message.header = header;
  message.result = FrameReport::INTEGRATED;
  message.reason = camera.remarks().on(frame, report.measured_pixels, *image.info, Clock::now());
  if (!pixels.color_fault().empty()) camera.remarks().warn_of_pixels(pixels.color_fault(), Clock::now());
  message.wait_ms = wait_ms;
  message.latency_ms = ms_since(image.arrival.time);
  return message;
}

/// Time has jumped back, for all cameras: an image of another one must not reset the map once more.
void MapperRos::Impl::start_again(const ros::Time& from, const ros::Time& to) {
  const bool reset = config_.on_time_jump == "reset";
  ROS_WARN("Time has jumped back by %s s: old transforms are forgotten, and the map is %s (~on_time_jump).",
           fixed_text(messages::seconds(to, from), 1).c_str(), reset ? "reset" : "kept");
  if (reset) mapper_.reset();
  for (const auto& camera : cameras_) camera->set_last_mapped(std::min(camera->last_mapped(), to));
}

/// The map has been replaced by another one, and not by a frame: it is told with the time of now.
void MapperRos::Impl::show_other_map() {
  surfels_ = static_cast<std::uint32_t>(mapper_.size());
  sequence_ = mapper_.sequence();
  state_.stamp = ros::Time::now();
  diagnostics_->set_map(mapper_.statistics(), mapper_.size_on_disk());
}

void MapperRos::Impl::reset_cameras() {
  for (const auto& camera : cameras_) camera->reset();
}

void MapperRos::Impl::pause(bool paused) {
  for (const auto& camera : cameras_) camera->pause(paused);
  diagnostics_->set_paused(paused);
}

void MapperRos::Impl::publish_changes() {
  if (!publisher_->wants_changes()) return;
  if (publisher_->sequence() == mapper_.sequence()) return;
  try {
    Changes changes = mapper_.changes(publisher_->sequence());
    const std::uint64_t since = changes.since;  // 0 if the publisher has waited for so long that it must begin again
    publisher_->push(std::move(changes), since, state_);
  } catch (const std::exception& fault) {
    if (publishing_faults_.due(fault.what(), Clock::now()) > 0) ROS_ERROR("The map cannot be published: %s", fault.what());
  }
}

void MapperRos::Impl::publish_to_planners() {
  if (!planner_publisher_->wants_changes()) return;
  try {
    push_to_planners();
  } catch (const std::exception& fault) {
    if (publishing_faults_.due(fault.what(), Clock::now()) > 0) ROS_ERROR("Planners cannot be told of the map: %s", fault.what());
  }
}

void MapperRos::Impl::push_to_planners() {
  std::optional<Changes> surfels;
  if (planner_publisher_->wants_surfels()) surfels = mapper_.changes(planner_publisher_->surfel_sequence());
  planner_publisher_->push(mapper_.state_changes(planner_publisher_->sequence(), config_.planner_resolution), std::move(surfels),
                           state_.stamp);
}

void MapperRos::Impl::after_work() {
  publish_changes();
  publish_to_planners();
  diagnostics_->set_map_folder_fault(folder_watch_.look(Clock::now()));
}

MapperRos::MapperRos(const ros::NodeHandle& nh, const ros::NodeHandle& pnh) : impl_(std::make_unique<Impl>(nh, pnh)) {}
MapperRos::~MapperRos() = default;
void MapperRos::stop() { impl_->stop(); }

}  // namespace frontier_surfels
