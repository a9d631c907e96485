#include "ros/input/camera_input.hpp"

#include <frontier_surfels/FrameReport.h>
#include <image_transport/exception.h>
#include <ros/console.h>
#include <ros/master.h>
#include <ros/this_node.h>

#include <set>
#include <utility>

namespace frontier_surfels {
namespace {

constexpr int kQueue = 10;  // messages; callbacks return at once, so that it is seldom used
constexpr auto kPoll = std::chrono::milliseconds(1);
constexpr auto kColorWait = std::chrono::milliseconds(30);  // a camera's period: mapping without colour is better than waiting longer

/// End of a sentence about a stamp that cannot be a time.
constexpr char kCorrectStamp[] = ", which is no time: correct the camera's driver, or the clock of its machine.";

/// The topics of images, for people.
std::string published_images() {
  using XmlRpc::XmlRpcValue;
  XmlRpcValue request, response, topics;
  request[0] = ros::this_node::getName();
  request[1] = "";
  std::set<std::string> names;
  if (ros::master::execute("getPublishedTopics", request, response, topics, false)) {
    for (int i = 0; i < topics.size(); ++i) {
      const std::string type = topics[i][1];
      if (type == "sensor_msgs/Image" || type == "sensor_msgs/CompressedImage") names.insert(topics[i][0]);
    }
  }
  if (names.empty()) return "No node publishes images.";
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return "The topics of images are: " + all + ".";
}

/// For people.
std::string installed_transports(const image_transport::ImageTransport& transport) {
  std::set<std::string> names = {"raw", "compressed", "compressedDepth"};
  for (const std::string& name : transport.getLoadableTransports()) names.insert(name.substr(name.find('/') + 1));
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

}  // namespace

CameraInput::CameraInput(const NodeConfig& config, CameraTopics topics, FramePoses& poses, Listener listener)
    : config_(config),
      topics_(std::move(topics)),
      poses_(poses),
      listener_(std::move(listener)),
      inbox_(std::chrono::duration<double>(config.tf_timeout)),
      remarks_(config.mapper, [](const std::string& remark) { ROS_WARN("%s", remark.c_str()); }) {}

CameraInput::~CameraInput() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void CameraInput::start(const ros::NodeHandle& nh, const ros::NodeHandle& pnh) {
  ros::NodeHandle handle(nh);
  info_topic_ = handle.resolveName(topics_.info);
  transport_ = std::make_unique<image_transport::ImageTransport>(handle);
  thread_ = std::thread([this] { run(); });
  info_ = handle.subscribe(topics_.info, kQueue, &CameraInput::add_info, this);
  if (config_.use_color) {
    const Transport transport = {config_.color_transport, pnh, "color_transport"};
    color_ = subscribe(handle, topics_.color, transport, [this](const auto& image) { add_color(image); });
  }
  const Transport transport = {config_.image_transport, pnh, "image_transport"};
  depth_ = subscribe(handle, topics_.depth, transport, [this](const auto& image) { add_depth({image, Clock::now()}); });
}

/// The two compressed transports that depth cameras use are decoded here, not by image_transport: their plugins need not be installed, and
/// the map is the same as that of a bag.
CameraInput::Subscription CameraInput::subscribe(ros::NodeHandle& nh, const std::string& topic, const Transport& transport,
                                                 const OnImage& on_image) {
  Subscription subscription;
  if (transport.name == "compressedDepth" || transport.name == "compressed") {
    const boost::function<void(const sensor_msgs::CompressedImageConstPtr&)> callback = [on_image](const auto& image) {
      on_image({nullptr, image});
    };
    subscription.compressed = nh.subscribe<sensor_msgs::CompressedImage>(nh.resolveName(topic) + "/" + transport.name, kQueue, callback);
    return subscription;
  }
  const boost::function<void(const sensor_msgs::ImageConstPtr&)> callback = [on_image](const auto& image) { on_image({image, nullptr}); };
  // The hints read the parameter once more. Without its name, that of the depth images would also choose the transport of the colour
  // images.
  const image_transport::TransportHints hints(transport.name, ros::TransportHints(), transport.pnh, transport.parameter);
  try {
    subscription.transported = transport_->subscribe(topic, kQueue, callback, ros::VoidPtr(), hints);
  } catch (const image_transport::Exception&) {
    throw Error("~" + transport.parameter + " is '" + transport.name + "', for which there is no plugin: install it, or choose one of " +
                installed_transports(*transport_) + ".");
  }
  return subscription;
}

void CameraInput::add_depth(const DepthArrival& arrival) {
  std::vector<DroppedImage> dropped;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    depth_came_ = true;
    try {
      if (paused_) throw DroppedFrame(FrameReport::DROPPED_PAUSED, "Mapping is paused: call ~pause with false to go on.");
      check_depth(arrival.image);
      dropped = follow_time(arrival.image.header());
      inbox_.add(arrival);
    } catch (const DroppedFrame& fault) {
      dropped.push_back({arrival, fault.result, fault.what()});
    }
  }
  tell(dropped);
  look_through();
  changed_.notify_all();
}

void CameraInput::add_info(const sensor_msgs::CameraInfoConstPtr& info) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!infos_.add(info)) warn_of_stamp("A camera_info is", info->header.stamp);
}

void CameraInput::add_color(const messages::ImageMessage& image) {
  const std::lock_guard<std::mutex> lock(mutex_);
  color_came_ = true;
  if (!colors_.add(image, Clock::now())) warn_of_stamp("A colour image is", image.header().stamp);
}

void CameraInput::warn_of_stamp(const std::string& what, const ros::Time& stamp) {
  const std::string warning = what + " not used: " + messages::late_stamp(stamp) + kCorrectStamp;
  if (stamp_warnings_.due(warning, Clock::now()) > 0) ROS_WARN("%s", warning.c_str());
}

/// Finds out whether time has jumped back. If so, everything of later times is forgotten at once, because tf takes no transforms that are
/// much older than those it has. @return the images that are dropped because of the jump @throws DroppedFrame if the image comes too late
std::vector<DroppedImage> CameraInput::follow_time(const std_msgs::Header& header) {
  constexpr double kLate = 1;  // [s]; no delay of transport is longer
  if (header.stamp.isZero())
    throw DroppedFrame(FrameReport::DROPPED_NO_POSE, "The image's stamp is 0, which is no time: its driver must set it.");
  if (!messages::is_believed(header.stamp))
    throw DroppedFrame(FrameReport::DROPPED_NO_POSE, "A depth image cannot be used: " + messages::late_stamp(header.stamp) + kCorrectStamp);
  if (messages::strip_slash(header.frame_id).empty())
    throw DroppedFrame(FrameReport::DROPPED_NO_POSE,
                       "The image's frame_id is empty: its driver must set it to the camera's optical frame.");
  const ros::Time now = ros::Time::now();
  clock_went_back_ = clock_went_back_ || now < last_now_;
  last_now_ = now;
  if (header.stamp >= inbox_.last_stamp()) return {};
  if (!clock_went_back_ && messages::seconds(header.stamp, inbox_.last_stamp()) <= kLate)
    throw DroppedFrame(FrameReport::DROPPED_OUT_OF_ORDER, "A depth image is older than the one before it: images must come in order.");
  clock_went_back_ = false;
  poses_.forget_future(header.frame_id, header.stamp);
  colors_.forget_future(header.stamp);
  infos_.keep_last();
  inbox_.forget_stamps();
  return inbox_.clear(FrameReport::DROPPED_OUT_OF_ORDER, "Time has jumped back while this depth image waited.");
}

void CameraInput::look_through() {
  std::vector<DroppedImage> dropped;
  bool is_any_new = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const Clock::time_point now = Clock::now();
    const std::uint64_t before = inbox_.completed();
    dropped = inbox_.look_through([&](const DepthArrival& arrival, bool last_chance) { return complete(arrival, now, last_chance); }, now);
    is_any_new = inbox_.completed() > before;
    if (is_any_new) clock_went_back_ = false;
  }
  tell(dropped);
  if (is_any_new) listener_.on_ready();
}

std::optional<CompleteImage> CameraInput::complete(const DepthArrival& arrival, Clock::time_point now, bool last_chance) const {
  const std_msgs::Header& header = arrival.image.header();
  if (!last_chance && !poses_.has(header.frame_id, header.stamp)) return std::nullopt;  // what is missing most often, and a quick answer
  CompleteImage image;
  image.arrival = arrival;
  try {
    image.info = info_of(arrival.image);
    image.T_world_camera = pose_of(header);
  } catch (const DroppedFrame&) {
    if (last_chance) throw;
    return std::nullopt;
  }
  if (now - arrival.time < kColorWait && colors_.is_due(header.stamp, now)) return std::nullopt;
  image.color = colors_.nearest(header.stamp);
  return image;
}

/// @throws DroppedFrame if there is none that fits
sensor_msgs::CameraInfoConstPtr CameraInput::info_of(const messages::ImageMessage& image) const {
  const sensor_msgs::CameraInfoConstPtr info = infos_.at(image.header().stamp);
  if (!info) {
    throw DroppedFrame(FrameReport::DROPPED_NO_CAMERA,
                       "No camera_info has come on " + info_topic_ + ": remap " + topics_.info + " to the depth camera's.");
  }
  check_camera(image, *info);
  return info;
}

/// @throws DroppedFrame if it is not known
Eigen::Isometry3d CameraInput::pose_of(const std_msgs::Header& header) const {
  try {
    return poses_.T_world_frame(header.frame_id, header.stamp);
  } catch (const BadFrame& fault) {
    throw DroppedFrame(FrameReport::DROPPED_NO_POSE, std::string("The pose at the image's stamp is not known: ") + fault.what() + ".");
  }
}

std::optional<ros::Time> CameraInput::next_stamp() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return inbox_.is_ready() ? std::make_optional(inbox_.next_stamp()) : std::nullopt;
}

std::optional<CompleteImage> CameraInput::take() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return inbox_.is_ready() ? std::make_optional(inbox_.take()) : std::nullopt;
}

std::vector<std::string> CameraInput::missing() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!depth_came_) {
    const std::string topic = depth_.topic(), none = "No depth image has come on " + topic;
    if (depth_.publishers() == 0)
      return {none + ", which no node publishes: remap " + topics_.depth +
              " to the topic of the depth camera, and check ~image_transport. " + published_images()};
    return {none + ", although a node publishes it: check with `rostopic hz " + topic +
            "` that it sends images, and that the machines reach each other (ROS_IP, ROS_HOSTNAME)."};
  }
  if (!config_.use_color || color_came_) return {};
  return {"No colour image has come on " + color_.topic() + ", so that the map gets no colour: remap " + topics_.color +
          " to images that are registered to depth and check ~color_transport, or set ~use_color to false."};
}

void CameraInput::pause(bool paused) {
  std::vector<DroppedImage> dropped;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    paused_ = paused;
    if (paused) dropped = inbox_.clear(FrameReport::DROPPED_PAUSED, "Mapping was paused before this depth image's turn.");
  }
  tell(dropped);
}

void CameraInput::reset() {
  std::vector<DroppedImage> dropped;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    dropped = inbox_.clear(FrameReport::DROPPED_QUEUE, "The map was reset before this depth image's turn.");
    inbox_.forget_stamps();
    colors_.forget_future(ros::Time());
    infos_.keep_last();
    last_now_ = ros::Time();
    clock_went_back_ = false;
  }
  last_mapped_ = ros::Time();
  remarks_.forget();
  tell(dropped);
}

void CameraInput::tell(const std::vector<DroppedImage>& dropped) const {
  for (const DroppedImage& image : dropped) listener_.on_dropped(image);
}

void CameraInput::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    changed_.wait(lock, [this] { return stopping_ || inbox_.is_waiting(); });
    lock.unlock();
    look_through();
    lock.lock();
    changed_.wait_for(lock, kPoll, [this] { return stopping_; });
  }
}

}  // namespace frontier_surfels
