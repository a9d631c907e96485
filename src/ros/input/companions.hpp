/// What arrives beside the depth images of a camera: its camera_infos and colour images.
#pragma once

#include <sensor_msgs/CameraInfo.h>

#include <chrono>
#include <deque>

#include "ros/input/camera_frame.hpp"

namespace frontier_surfels {

/// The camera_infos of one camera. Only those are kept in which the camera differs from the one before.
class CameraInfos {
 public:
  /// One whose stamp cannot be a time is kept only while there is none, as with bags. @return false if it is not kept therefore
  bool add(const sensor_msgs::CameraInfoConstPtr& info);

  /// The latest one with a stamp at or before `stamp`, else the earliest one that is kept; null before the first.
  sensor_msgs::CameraInfoConstPtr at(const ros::Time& stamp) const;

  /// Time has jumped back: only the camera_info that arrived last is kept.
  void keep_last();

 private:
  std::deque<sensor_msgs::CameraInfoConstPtr> infos_;  ///< in the order of arrival
};

/// The latest colour images of one camera.
class ColorImages {
 public:
  /// @return false if the stamp cannot be a time, and the image is left out
  bool add(const messages::ImageMessage& image, Clock::time_point now);

  /// The image whose stamp is nearest to `stamp`; empty if none is within kColorTolerance.
  messages::ImageMessage nearest(const ros::Time& stamp) const;

  /// Whether the colour for `stamp` may still arrive: images have arrived lately, but none of that time or later.
  bool is_due(const ros::Time& stamp, Clock::time_point now) const;

  /// Time has jumped back to `stamp`: images of later times are forgotten.
  void forget_future(const ros::Time& stamp);

 private:
  std::deque<messages::ImageMessage> images_;  ///< in the order of arrival
  Clock::time_point last_arrival_;
};

}  // namespace frontier_surfels
