/// Selects the messages of a bag that a replayed frame needs beside its depth image. Nothing is published here.
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

/// The messages of some topics of a bag, from the first to the last.
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

/// Transforms, joined to one message for each call: a second's separate messages at once would overflow the queues of subscribers.
class TransformStream {
 public:
  /// @param topic  tf or tf_static, with or without a slash
  TransformStream(const rosbag::Bag& bag, const std::string& topic);

  /// All transforms up to this time of the bag, except those taken before, and those of tf with stamps that BagTransforms does not believe.
  tf2_msgs::TFMessage take(const ros::Time& until);

 private:
  BagStream messages_;
  bool is_static_;
};

/// The cameras of frames, in order of the frames.
class CameraStream {
 public:
  CameraStream(const rosbag::Bag& bag, const std::string& topic);

  /// The last camera_info up to the stamp, or the first one if there is none; empty if it was returned before. Stamps must not decrease.
  std::optional<rosbag::MessageInstance> take(const ros::Time& stamp);

 private:
  BagStream messages_;
  bool is_known_ = false;
};

/// The colour images of frames, in order of the frames.
class ColorStream {
 public:
  ColorStream(const rosbag::Bag& bag, const std::string& topic);

  /// The last image before the stamp and the first one after it, of which one is the nearest, except those returned before. Stamps must
  /// not decrease.
  std::vector<rosbag::MessageInstance> take(const ros::Time& stamp);

 private:
  BagStream messages_;
  ros::Time known_until_;
};

}  // namespace frontier_surfels::replay
