/// Publishes the messages of a bag at the pace of a mapper.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <rosbag/message_instance.h>

#include <memory>
#include <optional>
#include <set>
#include <string>

#include "recordings/bag_source.hpp"
#include "recordings/bag_streams.hpp"
#include "ros/client/running_mapper.hpp"

namespace frontier_surfels::replay {

/// A topic that this program publishes, with a list of the nodes that subscribe to it.
class PlayedTopic {
 public:
  PlayedTopic(ros::NodeHandle& nh, ros::AdvertiseOptions options);

  std::string name() const { return publisher_.getTopic(); }
  bool reaches(const std::string& node) const { return listeners_->count(node) > 0; }

  template <typename Message>
  void publish(const Message& message) const {
    publisher_.publish(message);
  }

  /// Publishes a recorded message. Does nothing if it has another type than the first message of its topic.
  void publish(const rosbag::MessageInstance& message) const;

 private:
  std::string md5sum_;
  std::shared_ptr<std::multiset<std::string>> listeners_;
  ros::Publisher publisher_;
};

/// Publishes what one frame needs and little more, because a mapper's queues are short.
class BagPlayer {
 public:
  /// Advertises the bag's topics and waits until the mapper listens. @throws Error if it does not
  BagPlayer(const BagSource& source, RunningMapper& mapper);

  /// Sets the clock to the time at which a recording begins.
  void begin(const ros::Time& stamp) { set_clock(stamp); }

  void send_static_transforms();

  /// Sends all transforms up to this time of the bag.
  void send_transforms(const ros::Time& until);

  /// Sends the camera_info of a frame, and the colour images that may belong to it. Call this before the frame itself is sent, so that
  /// they arrive first.
  void send_camera_and_color(const ros::Time& stamp);

  /// Sends the clock, then the depth image.
  void send_depth(const rosbag::MessageInstance& message, const ros::Time& stamp);

  bool clock_is_heard() const { return clock_.reaches(mapper_.process()); }
  bool color_is_heard() const { return !color_ || color_->reaches(mapper_.process()); }
  const std::string& color_topic() const { return topics_.color; }

 private:
  void require_listener(const PlayedTopic& topic, const std::string& what_to_do);
  void set_clock(const ros::Time& stamp);

  RunningMapper& mapper_;
  const BagTopics topics_;
  ros::NodeHandle root_;  ///< for tf and the clock, which are global topics
  PlayedTopic clock_, tf_, tf_static_, depth_, info_;
  std::optional<PlayedTopic> color_;
  TransformStream transforms_, static_transforms_;
  CameraStream cameras_;
  ColorStream colors_;
  ros::Time clock_time_;
};

}  // namespace frontier_surfels::replay
