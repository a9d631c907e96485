/// One depth camera of the mapper.
#pragma once

#include <image_transport/image_transport.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "ros/input/companions.hpp"
#include "ros/input/frame_poses.hpp"
#include "ros/input/frame_remarks.hpp"
#include "ros/input/inbox.hpp"
#include "ros/input/parameters.hpp"

namespace frontier_surfels {

/// Names of a camera's topics, relative to the node.
struct CameraTopics {
  std::string depth;
  std::string info;   ///< of the depth images
  std::string color;  ///< registered to depth
};

/// Everything that belongs to one camera: its subscriptions, its camera_infos and colour images, its waiting depth images, and the order of
/// its stamps. Images wait here, not in the mapping thread, until they are complete. A thread of the camera's own looks for what they lack.
///
/// Time has jumped back when an image is older than the last complete one, and either ROS time has gone back or the difference is more than
/// a delay of transport can be. Transforms, colour images and waiting images of the time before the jump are then forgotten.
class CameraInput {
 public:
  /// Whom the camera tells. Called from any thread, with nothing locked.
  struct Listener {
    std::function<void()> on_ready;                       ///< an image is ready to be mapped
    std::function<void(const DroppedImage&)> on_dropped;  ///< an image will not be mapped
  };

  CameraInput(const NodeConfig& config, CameraTopics topics, FramePoses& poses, Listener listener);
  ~CameraInput();

  /// Subscribes the topics and begins to look for what images lack. To be called once. @param pnh  where the parameters were read
  /// @throws Error if an image transport is not installed
  void start(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);

  // What arrives. From any thread.
  void add_depth(const DepthArrival& arrival);
  void add_info(const sensor_msgs::CameraInfoConstPtr& info);
  void add_color(const messages::ImageMessage& image);

  /// Looks once for images that are complete, and for those that have waited too long.
  void look_through();

  /// Stamp of the image that take() would give; empty if none is ready.
  std::optional<ros::Time> next_stamp() const;

  /// Takes the next ready image; empty if there is none.
  std::optional<CompleteImage> take();

  /// Sentences about the topics on which no image has come yet, with the likely cause and what to do.
  std::vector<std::string> missing() const;

  /// While the camera is paused its images are dropped, those included that wait already.
  void pause(bool paused);

  /// The map is reset: what waits is dropped, and the next image may have any stamp. For the mapping thread.
  void reset();

  /// Stamp of the last image that was mapped; 0 if there is none. For the mapping thread, which keeps it up to date.
  const ros::Time& last_mapped() const { return last_mapped_; }
  void set_last_mapped(const ros::Time& stamp) { last_mapped_ = stamp; }

  /// For the mapping thread.
  FrameRemarks& remarks() { return remarks_; }

 private:
  struct Subscription {  // one of the two
    image_transport::Subscriber transported;
    ros::Subscriber compressed;

    std::string topic() const { return compressed ? compressed.getTopic() : transported.getTopic(); }
    std::uint32_t publishers() const { return compressed ? compressed.getNumPublishers() : transported.getNumPublishers(); }
  };
  struct Transport {
    std::string name;
    ros::NodeHandle pnh;
    std::string parameter;  ///< of pnh, that has the name
  };
  using OnImage = std::function<void(const messages::ImageMessage&)>;

  Subscription subscribe(ros::NodeHandle& nh, const std::string& topic, const Transport& transport, const OnImage& on_image);
  void run();
  void tell(const std::vector<DroppedImage>& dropped) const;

  // With mutex_ locked
  void warn_of_stamp(const std::string& what, const ros::Time& stamp);
  std::vector<DroppedImage> follow_time(const std_msgs::Header& header);
  std::optional<CompleteImage> complete(const DepthArrival& arrival, Clock::time_point now, bool last_chance) const;
  sensor_msgs::CameraInfoConstPtr info_of(const messages::ImageMessage& image) const;
  Eigen::Isometry3d pose_of(const std_msgs::Header& header) const;

  const NodeConfig config_;
  const CameraTopics topics_;
  FramePoses& poses_;
  const Listener listener_;

  mutable std::mutex mutex_;  ///< guards inbox_ to clock_went_back_
  std::condition_variable changed_;
  Inbox inbox_;
  CameraInfos infos_;
  ColorImages colors_;
  bool paused_ = false, stopping_ = false;
  bool depth_came_ = false, color_came_ = false;
  WarningThrottle stamp_warnings_{std::chrono::seconds(10)};
  ros::Time last_now_;            ///< ROS time when the last image arrived
  bool clock_went_back_ = false;  ///< since the last image that became ready

  ros::Time last_mapped_;  ///< the mapping thread's own
  FrameRemarks remarks_;   ///< the mapping thread's own
  std::thread thread_;
  std::string info_topic_;  ///< resolved, for people
  std::unique_ptr<image_transport::ImageTransport> transport_;
  ros::Subscriber info_;
  Subscription depth_, color_;  // the last members: they call back
};

}  // namespace frontier_surfels
