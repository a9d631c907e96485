#include "ros/mapper_ros.hpp"

#include <frontier_surfels/FrameReport.h>
#include <frontier_surfels/GetSurfels.h>
#include <frontier_surfels/MapFile.h>
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <future>

#include "frontier_surfels/map_file.hpp"
#include "frontier_surfels/mapper.hpp"
#include "ros/input/frame_reader.hpp"
#include "ros/output/map_publisher.hpp"
#include "ros/output/mapper_diagnostics.hpp"
#include "ros/output/surfel_messages.hpp"
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

Eigen::Vector3f to_vector(const geometry_msgs::Point& p) { return Eigen::Vector3d(p.x, p.y, p.z).cast<float>(); }

}  // namespace

class MapperRos::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~Impl();

 private:
  // Callbacks of the inputs
  void on_depth(const DepthArrival& arrival);

  // On the worker's thread
  void process(const DepthArrival& arrival);
  bool has_jumped_back(const std_msgs::Header& header);
  void start_again(const ros::Time& stamp);
  void publish_changes();
  void report_dropped(const DepthArrival& arrival, std::uint8_t result, const std::string& reason);

  // Services
  void start_services();
  template <typename Message>
  void serve(const std::string& name, bool (Impl::*handler)(typename Message::Request&, typename Message::Response&));
  template <typename Response, typename Job>
  bool answer(Response& response, Job job);
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool save_map(MapFile::Request& request, MapFile::Response& response);
  bool load_map(MapFile::Request& request, MapFile::Response& response);
  bool get_surfels(GetSurfels::Request& request, GetSurfels::Response& response);

  ros::NodeHandle nh_, pnh_;
  const NodeConfig config_;
  Mapper mapper_;  // the worker's alone
  FramePoses poses_;
  MapState state_;
  ros::Time last_stamp_, last_now_;
  bool clock_went_back_ = false;  ///< since the last frame that was mapped
  std::atomic<bool> paused_{false};
  std::atomic<bool> stopping_{false};
  std::atomic<std::uint32_t> surfels_{0};  ///< in the map, for reports of frames that are not mapped
  std::atomic<std::uint64_t> sequence_{0};

  ros::Publisher reports_;
  std::unique_ptr<MapPublisher> publisher_;
  std::unique_ptr<Worker<DepthArrival>> worker_;
  std::unique_ptr<FrameInput> input_;
  std::unique_ptr<FrameReader> reader_;
  std::unique_ptr<MapperDiagnostics> diagnostics_;
  ros::CallbackQueue service_queue_;  // a service waits for the frame at hand: it must not hold up the images
  ros::NodeHandle service_nh_;
  std::vector<ros::ServiceServer> services_;
  std::unique_ptr<ros::AsyncSpinner> service_spinner_;
};

MapperRos::Impl::Impl(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh), pnh_(pnh), config_(read_and_warn(pnh)), mapper_(config_.mapper), poses_(nh, config_.world_frame), service_nh_(pnh) {
  reports_ = pnh_.advertise<FrameReport>("report", 100);
  worker_ =
      std::make_unique<Worker<DepthArrival>>([this](const DepthArrival& arrival) { process(arrival); }, [this] { publish_changes(); });
  publisher_ = std::make_unique<MapPublisher>(pnh_, config_, [this] { worker_->wake(); });
  input_ = std::make_unique<FrameInput>(nh_, config_);
  reader_ = std::make_unique<FrameReader>(config_, *input_, poses_, [this] { return stopping_.load(); });
  diagnostics_ = std::make_unique<MapperDiagnostics>(nh_, pnh_, mapper_.device(), nh_.resolveName("depth/image"));
  start_services();
  worker_->start();
  input_->start([this](const DepthArrival& arrival) { on_depth(arrival); });
  ROS_INFO("Mapping %s in the frame %s on %s.", input_->depth_topic().c_str(), config_.world_frame.c_str(), mapper_.device().c_str());
}

void MapperRos::Impl::start_services() {
  service_nh_.setCallbackQueue(&service_queue_);
  serve<std_srvs::Trigger>("reset", &Impl::reset);
  serve<std_srvs::SetBool>("pause", &Impl::pause);
  serve<MapFile>("save_map", &Impl::save_map);
  serve<MapFile>("load_map", &Impl::load_map);
  serve<GetSurfels>("get_surfels", &Impl::get_surfels);
  service_spinner_ = std::make_unique<ros::AsyncSpinner>(1, &service_queue_);
  service_spinner_->start();
}

MapperRos::Impl::~Impl() {
  stopping_ = true;
  worker_->stop();  // it asks the inputs while it waits
  input_.reset();
  service_spinner_->stop();
  publisher_.reset();
}

void MapperRos::Impl::on_depth(const DepthArrival& arrival) {
  if (paused_) return report_dropped(arrival, FrameReport::DROPPED_PAUSED, "Mapping is paused: call ~pause with false to go on.");
  if (const auto replaced = worker_->put(arrival)) {
    report_dropped(*replaced, FrameReport::DROPPED_QUEUE, "A newer depth image came before this one's turn.");
  }
}

void MapperRos::Impl::report_dropped(const DepthArrival& arrival, std::uint8_t result, const std::string& reason) {
  FrameReport message;
  message.header = arrival.image.header();
  message.result = result;
  message.reason = reason;
  message.surfels = surfels_;
  message.sequence = sequence_;
  message.latency_ms = message.wait_ms = ms_since(arrival.time);
  reports_.publish(message);
  diagnostics_->add(message);
}

void MapperRos::Impl::process(const DepthArrival& arrival) {
  const std_msgs::Header& header = arrival.image.header();
  try {
    const bool time_jumped = has_jumped_back(header);
    const replay::RecordedFrame frame = reader_->read(arrival.image);
    // Only now: an image of a senseless stamp has no pose, and must not cost the map.
    if (time_jumped) start_again(header.stamp);
    last_stamp_ = header.stamp;
    clock_went_back_ = false;
    const double wait_ms = ms_since(arrival.time);
    const Report report = mapper_.integrate(frame.view());
    surfels_ = static_cast<std::uint32_t>(report.surfels);
    sequence_ = report.sequence;
    state_ = {header.stamp, CameraView{frame.T_world_camera, frame.intrinsics, config_.mapper.z_max}};

    FrameReport message = messages::to_message(report);
    message.header = header;
    message.result = FrameReport::INTEGRATED;
    message.wait_ms = wait_ms;
    message.latency_ms = ms_since(arrival.time);
    reports_.publish(message);
    diagnostics_->add(message);
    diagnostics_->set_memory(report.map_bytes, report.device_bytes);
  } catch (const DroppedFrame& fault) {
    report_dropped(arrival, fault.result, fault.what());
  } catch (const BadFrame& fault) {
    report_dropped(arrival, FrameReport::DROPPED_BAD_IMAGE, fault.what());
  } catch (const std::exception& fault) {
    report_dropped(arrival, FrameReport::FAILED, fault.what());
  }
}

/// A stamp before the last one's: time has jumped, as in a bag that loops, or the image is merely late. tf must forget the old time at
/// once, or it would take no transforms of the new one.
bool MapperRos::Impl::has_jumped_back(const std_msgs::Header& header) {
  constexpr double kLate = 1;  // [s]; more is no delay of transport
  const ros::Time now = ros::Time::now();
  clock_went_back_ = clock_went_back_ || now < last_now_;
  last_now_ = now;
  if (header.stamp.isZero() || header.stamp >= last_stamp_) return false;
  if (!clock_went_back_ && messages::seconds(header.stamp, last_stamp_) <= kLate)
    throw DroppedFrame(FrameReport::DROPPED_OUT_OF_ORDER, "A depth image is older than the one before it: images must come in order.");
  poses_.forget_future(header.frame_id, header.stamp);
  input_->forget_future(header.stamp);
  return true;
}

void MapperRos::Impl::start_again(const ros::Time& stamp) {
  const bool reset = config_.on_time_jump == "reset";
  ROS_WARN("Time has jumped back by %.1f s: old transforms are forgotten, and the map is %s (~on_time_jump).",
           messages::seconds(stamp, last_stamp_), reset ? "reset" : "kept");
  if (reset) mapper_.reset();
}

void MapperRos::Impl::publish_changes() {
  if (!publisher_->wants_changes()) return;
  const std::uint64_t since = publisher_->sequence();
  if (since == mapper_.sequence()) return;
  try {
    publisher_->push(mapper_.changes(since), since, state_);
  } catch (const std::exception& fault) {
    ROS_ERROR_THROTTLE(5, "The map cannot be published: %s", fault.what());
  }
}

template <typename Message>
void MapperRos::Impl::serve(const std::string& name, bool (Impl::*handler)(typename Message::Request&, typename Message::Response&)) {
  services_.push_back(service_nh_.advertiseService(name, handler, this));
}

/// Runs the job, which returns the sentence of success, and tells its outcome. @return false if the mapper is shutting down
template <typename Response, typename Job>
bool MapperRos::Impl::answer(Response& response, Job job) {
  try {
    response.message = job();
    response.success = true;
  } catch (const std::future_error&) {
    return false;
  } catch (const std::exception& fault) {
    response.message = fault.what();
    response.success = false;
    ROS_WARN("%s", fault.what());
  }
  return true;
}

bool MapperRos::Impl::reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer(response, [&] {
    worker_->run_job([&] {
      mapper_.reset();
      surfels_ = 0;
      sequence_ = mapper_.sequence();
      last_stamp_ = last_now_ = ros::Time();
      input_->forget_future(ros::Time());  // what comes next may be of any time
    });
    return std::string("The map is empty.");
  });
}

bool MapperRos::Impl::pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  paused_ = request.data;
  diagnostics_->set_paused(request.data);
  response.success = true;
  response.message = request.data ? "Mapping is paused." : "Mapping goes on.";
  return true;
}

bool MapperRos::Impl::save_map(MapFile::Request& request, MapFile::Response& response) {
  return answer(response, [&] {
    if (request.path.empty()) throw FileError("No path was given: give that of the file to be written, which ends in .ply or .pcd.");
    const auto surfels = worker_->run_job([&] { return mapper_.surfels(); });
    write_map(request.path, surfels);  // takes time, but not the mapper's
    return std::to_string(surfels.size()) + " surfels are in " + request.path + ".";
  });
}

bool MapperRos::Impl::load_map(MapFile::Request& request, MapFile::Response& response) {
  return answer(response, [&] {
    worker_->run_job([&] {
      mapper_.load(request.path);
      surfels_ = static_cast<std::uint32_t>(mapper_.size());
      sequence_ = mapper_.sequence();
    });
    return std::to_string(surfels_) + " surfels were read from " + request.path + ".";
  });
}

bool MapperRos::Impl::get_surfels(GetSurfels::Request& request, GetSurfels::Response& response) {
  const Eigen::AlignedBox3f box(to_vector(request.box_min), to_vector(request.box_max));
  try {
    const auto surfels = worker_->run_job([&] {
      response.sequence = mapper_.sequence();
      return box.min() == box.max() ? mapper_.surfels() : mapper_.surfels(box);
    });
    response.surfels = messages::to_cloud(surfels);
  } catch (const std::exception& fault) {  // a service has no other way to say it
    ROS_WARN("~get_surfels cannot be answered: %s", fault.what());
    return false;
  }
  response.surfels.header.frame_id = config_.world_frame;
  response.surfels.header.stamp = ros::Time::now();
  return true;
}

MapperRos::MapperRos(const ros::NodeHandle& nh, const ros::NodeHandle& pnh) : impl_(std::make_unique<Impl>(nh, pnh)) {}
MapperRos::~MapperRos() = default;

}  // namespace frontier_surfels
