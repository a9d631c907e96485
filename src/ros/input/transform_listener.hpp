/// Receives transforms.
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <ros/subscriber.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <string>

#include "ros/input/warning_throttle.hpp"

namespace frontier_surfels {

/// What is wrong with a transform, as a part of a sentence; empty if tf can use it.
std::string fault_of(const geometry_msgs::TransformStamped& transform, bool is_static);

/// Puts the transforms of /tf and /tf_static into a buffer, on a thread of its own. tf2_ros' own listener ends the node at a transform
/// whose stamp is near the largest one, and tf2 prints two lines for each transform that it cannot use: here such transforms are left out,
/// with one warning every few seconds for each fault.
class TransformListener {
 public:
  TransformListener(tf2::BufferCore& buffer, const ros::NodeHandle& nh);

 private:
  using Event = ros::MessageEvent<const tf2_msgs::TFMessage>;

  void add(const Event& event, bool is_static);
  void follow_time();
  void add(const geometry_msgs::TransformStamped& transform, const std::string& sender, bool is_static);

  tf2::BufferCore& buffer_;
  ros::Time last_now_;
  WarningThrottle warnings_{std::chrono::seconds(5)};
  ros::CallbackQueue queue_;
  ros::Subscriber moving_, static_;
  ros::AsyncSpinner spinner_{1, &queue_};  // the last member: it calls back
};

}  // namespace frontier_surfels
