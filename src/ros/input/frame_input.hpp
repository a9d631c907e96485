/// The mapper's inputs: the newest depth image, and what belongs to it.
#pragma once

#include <image_transport/image_transport.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <chrono>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "ros/input/conversions.hpp"
#include "ros/input/parameters.hpp"

namespace frontier_surfels {

using Clock = std::chrono::steady_clock;

/// A depth image as it arrived.
struct DepthArrival {
  messages::ImageMessage image;
  Clock::time_point time;
};

/// Subscriptions. All functions may be called from any thread; callbacks only store.
class FrameInput {
 public:
  using OnDepth = std::function<void(const DepthArrival&)>;

  FrameInput(const ros::NodeHandle& nh, const NodeConfig& config);

  /// Subscribes `depth/image`, `depth/camera_info` and, if config.use_color, `color/image`.
  /// @throws Error if the image transport is not installed
  void start(OnDepth on_depth);

  /// The latest camera_info at or before `stamp`, else the earliest kept; null before the first.
  sensor_msgs::CameraInfoConstPtr camera_info(const ros::Time& stamp) const;

  /// The colour image nearest to `stamp`; empty if none is within kColorTolerance.
  messages::ImageMessage color_near(const ros::Time& stamp) const;

  /// Whether colour for `stamp` can still be expected: it has been coming lately, but not yet up to that time.
  bool color_is_due(const ros::Time& stamp) const;

  /// Time has jumped back to `stamp`: forgets what is of the future.
  void forget_future(const ros::Time& stamp);

  /// The resolved names, for people.
  std::string depth_topic() const;
  std::string info_topic() const { return info_.getTopic(); }

 private:
  struct Subscription {  // one of the two
    image_transport::Subscriber transported;
    ros::Subscriber compressed;
  };
  using OnImage = std::function<void(const messages::ImageMessage&)>;
  Subscription subscribe(const std::string& topic, const std::string& transport, const OnImage& on_image);
  void add_camera(const sensor_msgs::CameraInfoConstPtr& info);
  void add_color(const messages::ImageMessage& image);

  ros::NodeHandle nh_;
  const NodeConfig config_;
  image_transport::ImageTransport transport_;
  mutable std::mutex mutex_;
  std::deque<sensor_msgs::CameraInfoConstPtr> cameras_;  ///< in the order of arrival; only where the camera changes
  std::deque<messages::ImageMessage> colors_;
  Clock::time_point last_color_;
  Subscription depth_, color_;  // the last members: they call back
  ros::Subscriber info_;
};

}  // namespace frontier_surfels
