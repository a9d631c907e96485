#include "ros/input/transform_listener.hpp"

#include <ros/console.h>

#include <cmath>

#include "ros/input/conversions.hpp"

namespace frontier_surfels {

using messages::strip_slash;

std::string fault_of(const geometry_msgs::TransformStamped& transform, bool is_static) {
  constexpr double kTolerance = 1e-2;  // tf's own
  const std::string parent = strip_slash(transform.header.frame_id), child = strip_slash(transform.child_frame_id);
  if (child.empty()) return "its child_frame_id is empty";
  if (parent.empty()) return "its frame_id is empty";
  if (parent == child) return "both its frames are the same";
  // tf would take all true stamps for too old, and its own sums overflow near the largest stamp.
  if (!is_static && !messages::is_believed(transform.header.stamp)) return messages::late_stamp(transform.header.stamp);
  const geometry_msgs::Quaternion& q = transform.transform.rotation;
  const geometry_msgs::Vector3& t = transform.transform.translation;
  if (!std::isfinite(t.x + t.y + t.z + q.x + q.y + q.z + q.w)) return "its numbers are not finite";
  if (std::abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1) > kTolerance) return "its quaternion is not one of length 1";
  return {};
}

TransformListener::TransformListener(tf2::BufferCore& buffer, const ros::NodeHandle& nh) : buffer_(buffer) {
  ros::NodeHandle handle(nh);
  handle.setCallbackQueue(&queue_);
  const boost::function<void(const Event&)> add_moving = [this](const Event& event) { add(event, false); };
  const boost::function<void(const Event&)> add_static = [this](const Event& event) { add(event, true); };
  moving_ = handle.subscribe<tf2_msgs::TFMessage>("/tf", 100, add_moving);
  static_ = handle.subscribe<tf2_msgs::TFMessage>("/tf_static", 100, add_static);
  spinner_.start();
}

void TransformListener::add(const Event& event, bool is_static) {
  follow_time();
  for (const geometry_msgs::TransformStamped& transform : event.getMessage()->transforms)
    add(transform, event.getPublisherName(), is_static);
}

void TransformListener::add(const geometry_msgs::TransformStamped& transform, const std::string& sender, bool is_static) {
  std::string fault = fault_of(transform, is_static);
  try {
    if (fault.empty()) buffer_.setTransform(transform, sender, is_static);
  } catch (const std::exception& error) {
    fault = error.what();
  }
  if (fault.empty()) return;
  const std::string warning = "A transform from '" + transform.child_frame_id + "' to '" + transform.header.frame_id +
                              "' is not used: " + fault + ". Correct it in the node that sends it, " + sender + ".";
  if (warnings_.due(warning, WarningThrottle::Clock::now()) > 0) ROS_WARN("%s", warning.c_str());
}

/// tf takes no transforms that are much older than those it has. They are forgotten when ROS time goes back.
void TransformListener::follow_time() {
  const ros::Time now = ros::Time::now();
  if (now < last_now_) buffer_.clear();
  last_now_ = now;
}

}  // namespace frontier_surfels
