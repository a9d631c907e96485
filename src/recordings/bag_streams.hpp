/// What of a bag belongs to a frame that is played, beside its depth image. No ROS communication in it.
#pragma once

#include <rosbag/bag.h>
#include <rosbag/message_instance.h>
#include <rosbag/view.h>
#include <tf2_msgs/TFMessage.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace frontier_surfels::replay {

/// Messages of some of a bag's topics, from the first to the last.
class BagStream {
 public:
  BagStream(const rosbag::Bag& bag, const std::function<bool(const std::string&)>& is_wanted);

  bool at_end() { return next_ == view_.end(); }
  const rosbag::MessageInstance& peek() { return *next_; }
  rosbag::MessageInstance take();

 private:
  rosbag::View view_;
  rosbag::View::iterator next_;
};

/// Transforms, in one message each time: a second's messages in one go would overrun the queues of those who listen.
class TransformStream {
 public:
  /// @param topic  tf or tf_static, with or without a slash
  TransformStream(const rosbag::Bag& bag, const std::string& topic);

  /// All up to this time of the bag that have not been taken so far.
  tf2_msgs::TFMessage take(const ros::Time& until);

 private:
  BagStream messages_;
};

/// Cameras of frames whose stamps do not decrease.
class CameraStream {
 public:
  CameraStream(const rosbag::Bag& bag, const std::string& topic);

  /// The last camera_info up to the stamp, or else the first one; empty if it is known already.
  std::optional<rosbag::MessageInstance> take(const ros::Time& stamp);

 private:
  BagStream messages_;
  bool is_known_ = false;
};

/// Colour images of frames whose stamps do not decrease.
class ColorStream {
 public:
  ColorStream(const rosbag::Bag& bag, const std::string& topic);

  /// The last one before the stamp and the first one from it on, those known already left out: the nearest is one of the two.
  std::vector<rosbag::MessageInstance> take(const ros::Time& stamp);

 private:
  BagStream messages_;
  ros::Time known_until_;
};

}  // namespace frontier_surfels::replay
