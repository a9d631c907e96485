/// Reads bags of ROS 1, without a ROS master.
#pragma once

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "recordings/bag_topics.hpp"
#include "recordings/bag_transforms.hpp"
#include "recordings/frame_source.hpp"
#include "recordings/selection.hpp"
#include "ros/input/conversions.hpp"
#include "ros/input/frame_remarks.hpp"

namespace frontier_surfels::replay {

/// The images of one topic in the order of the bag. Only the few near the last requested stamp are kept in memory.
class ImageWindow {
 public:
  ImageWindow(const rosbag::Bag& bag, const std::string& topic);

  /// The image nearest to `stamp`, or an empty one if none is within the tolerance. Stamps must not decrease from call to call.
  ImageMessage nearest(const ros::Time& stamp);

 private:
  rosbag::View view_;
  rosbag::View::iterator next_;
  std::deque<ImageMessage> window_;
};

/// Reads all transforms and cameras in the constructor, and the images one by one afterwards.
class BagSource : public FrameSource {
 public:
  BagSource(const std::string& path, const SourceOptions& options);

  std::size_t size() const override { return selection_.count; }
  std::optional<RecordedFrame> next() override;
  const std::vector<std::string>& skipped() const override { return skipped_; }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::vector<std::string> warnings() const override { return warnings_; }
  std::string world_frame() const override { return world_; }
  std::string if_still() const override;

  const rosbag::Bag& bag() const { return bag_; }
  const BagTopics& topics() const { return topics_; }

  /// The depth message of the last frame of next().
  const rosbag::MessageInstance& message() const { return *message_; }

 private:
  void open(const std::string& path);
  void read_transforms_and_cameras();
  void read_transforms_or_camera(const rosbag::MessageInstance& message);
  void choose_world(const std::string& wanted);
  RecordedFrame read(const rosbag::MessageInstance& message);
  const sensor_msgs::CameraInfo& camera_at(const ros::Time& stamp) const;
  cv::Mat color_at(const ros::Time& stamp, const cv::Size& depth_size);
  void note_once(const std::string& sentence);

  rosbag::Bag bag_;
  BagTopics topics_;
  BagTransforms transforms_;
  std::vector<std::pair<ros::Time, sensor_msgs::CameraInfo>> cameras_;  ///< in order of stamps; repeated cameras are left out
  std::string world_;
  std::unique_ptr<rosbag::View> depth_view_;
  rosbag::View::iterator next_depth_;
  std::optional<rosbag::MessageInstance> message_;
  std::unique_ptr<ImageWindow> color_images_;
  Selection selection_;
  std::size_t done_ = 0;  ///< frames of the selection that are read
  std::vector<std::string> skipped_;
  std::vector<std::string> notes_, warnings_;
  CameraRemarks remarks_{"choose with --depth-topic", "Choose the topics of one camera with --depth-topic and --info-topic."};
};

}  // namespace frontier_surfels::replay
