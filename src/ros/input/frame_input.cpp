#include "ros/input/frame_input.hpp"

#include <image_transport/exception.h>

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

constexpr std::size_t kColorsKept = 40;  // more than a second of a camera: a replay may send colour ahead
constexpr std::size_t kCamerasKept = 16;
constexpr auto kColorLately = std::chrono::seconds(1);

bool same_camera(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b) {
  sensor_msgs::CameraInfo with_header_of_b = a;
  with_header_of_b.header = b.header;
  return with_header_of_b == b;
}

constexpr double kFuture = 2;  // [s]; a little may be there rightly, from a replay that sends ahead

double offset(const messages::ImageMessage& image, const ros::Time& stamp) { return messages::seconds(stamp, image.header().stamp); }

}  // namespace

FrameInput::FrameInput(const ros::NodeHandle& nh, const NodeConfig& config) : nh_(nh), config_(config), transport_(nh) {}

void FrameInput::start(OnDepth on_depth) {
  info_ = nh_.subscribe("depth/camera_info", 5, &FrameInput::add_camera, this);
  if (config_.use_color) color_ = subscribe("color/image", config_.color_transport, [this](const auto& image) { add_color(image); });
  depth_ = subscribe("depth/image", config_.image_transport, [on_depth](const auto& image) { on_depth({image, Clock::now()}); });
}

/// The two transports that depth cameras use are decoded by ourselves: then they need not be installed, and live maps equal those from
/// bags.
FrameInput::Subscription FrameInput::subscribe(const std::string& topic, const std::string& transport, const OnImage& on_image) {
  constexpr int kQueue = 2;
  Subscription subscription;
  if (transport == "compressedDepth" || transport == "compressed") {
    const boost::function<void(const sensor_msgs::CompressedImageConstPtr&)> callback = [on_image](const auto& image) {
      on_image({nullptr, image});
    };
    subscription.compressed = nh_.subscribe<sensor_msgs::CompressedImage>(nh_.resolveName(topic) + "/" + transport, kQueue, callback);
    return subscription;
  }
  const boost::function<void(const sensor_msgs::ImageConstPtr&)> callback = [on_image](const auto& image) { on_image({image, nullptr}); };
  try {
    subscription.transported = transport_.subscribe(topic, kQueue, callback, ros::VoidPtr(), image_transport::TransportHints(transport));
  } catch (const image_transport::Exception& error) {
    throw Error("The image transport '" + transport + "' cannot be used for " + topic + " (" + error.what() +
                "): install its plugin, or choose raw.");
  }
  return subscription;
}

void FrameInput::add_camera(const sensor_msgs::CameraInfoConstPtr& info) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!cameras_.empty() && same_camera(*info, *cameras_.back())) return;
  cameras_.push_back(info);
  if (cameras_.size() > kCamerasKept) cameras_.pop_front();
}

sensor_msgs::CameraInfoConstPtr FrameInput::camera_info(const ros::Time& stamp) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  sensor_msgs::CameraInfoConstPtr found = cameras_.empty() ? nullptr : cameras_.front();
  for (const auto& camera : cameras_) {
    if (camera->header.stamp <= stamp) found = camera;
  }
  return found;
}

void FrameInput::add_color(const messages::ImageMessage& image) {
  const std::lock_guard<std::mutex> lock(mutex_);
  last_color_ = Clock::now();
  colors_.push_back(image);
  if (colors_.size() > kColorsKept) colors_.pop_front();
}

messages::ImageMessage FrameInput::color_near(const ros::Time& stamp) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto best = std::min_element(colors_.begin(), colors_.end(),
                                     [&](const auto& a, const auto& b) { return std::abs(offset(a, stamp)) < std::abs(offset(b, stamp)); });
  return best != colors_.end() && std::abs(offset(*best, stamp)) <= messages::kColorTolerance ? *best : messages::ImageMessage();
}

bool FrameInput::color_is_due(const ros::Time& stamp) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !colors_.empty() && Clock::now() - last_color_ < kColorLately && colors_.back().header().stamp < stamp;
}

void FrameInput::forget_future(const ros::Time& stamp) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto is_future = [&](const messages::ImageMessage& image) { return offset(image, stamp) > kFuture; };
  colors_.erase(std::remove_if(colors_.begin(), colors_.end(), is_future), colors_.end());
  if (cameras_.size() > 1) cameras_.erase(cameras_.begin(), cameras_.end() - 1);
}

std::string FrameInput::depth_topic() const { return depth_.compressed ? depth_.compressed.getTopic() : depth_.transported.getTopic(); }

}  // namespace frontier_surfels
