#include "replay/bag_player.hpp"

#include <ros/single_subscriber_publisher.h>
#include <rosgraph_msgs/Clock.h>

#include <algorithm>

namespace frontier_surfels::replay {

namespace {

constexpr std::uint32_t kNoLimit = 0;  // of a publisher's queue: the mapper's reports say when to send more

template <typename Message>
ros::AdvertiseOptions of_type(const std::string& topic, bool latch = false) {
  ros::AdvertiseOptions options;
  options.init<Message>(topic, kNoLimit);
  options.latch = latch;
  return options;
}

/// Options with the message type with which the topic was recorded.
ros::AdvertiseOptions as_recorded(const rosbag::Bag& bag, const std::string& topic) {
  rosbag::View view(bag, [&topic](const rosbag::ConnectionInfo* connection) { return connection->topic == topic; });
  const rosbag::ConnectionInfo& connection = *view.getConnections().at(0);
  return ros::AdvertiseOptions(topic, kNoLimit, connection.md5sum, connection.datatype, connection.msg_def);
}

}  // namespace

PlayedTopic::PlayedTopic(ros::NodeHandle& nh, ros::AdvertiseOptions options)
    : md5sum_(options.md5sum), listeners_(std::make_shared<std::multiset<std::string>>()) {
  const auto listeners = listeners_;
  options.connect_cb = [listeners](const ros::SingleSubscriberPublisher& listener) { listeners->insert(listener.getSubscriberName()); };
  options.disconnect_cb = [listeners](const ros::SingleSubscriberPublisher& listener) {
    const auto found = listeners->find(listener.getSubscriberName());
    if (found != listeners->end()) listeners->erase(found);
  };
  publisher_ = nh.advertise(options);
}

void PlayedTopic::publish(const rosbag::MessageInstance& message) const {
  if (message.getMD5Sum() == md5sum_) publisher_.publish(message);
}

BagPlayer::BagPlayer(const BagSource& source, RunningMapper& mapper)
    : mapper_(mapper),
      topics_(source.topics()),
      root_(mapper.handle(), "/"),
      clock_(root_, of_type<rosgraph_msgs::Clock>("clock")),
      tf_(root_, of_type<tf2_msgs::TFMessage>("tf")),
      tf_static_(root_, of_type<tf2_msgs::TFMessage>("tf_static", true)),
      depth_(mapper.handle(), as_recorded(source.bag(), topics_.depth)),
      info_(mapper.handle(), as_recorded(source.bag(), topics_.info)),
      transforms_(source.bag(), "tf"),
      static_transforms_(source.bag(), "tf_static"),
      cameras_(source.bag(), topics_.info),
      colors_(source.bag(), topics_.color) {
  if (!topics_.color.empty()) color_.emplace(mapper.handle(), as_recorded(source.bag(), topics_.color));
  require_listener(depth_,
                   "remap its depth/image when you start it (mapper.launch: depth_image, and image_transport for compressed images), or "
                   "choose another topic of the bag with --depth-topic");
  require_listener(info_,
                   "remap its depth/camera_info when you start it (mapper.launch: depth_info), or choose another topic of the bag with "
                   "--info-topic");
  require_listener(tf_, "do not remap it");
}

void BagPlayer::require_listener(const PlayedTopic& topic, const std::string& what_to_do) {
  mapper_.require([&] { return topic.reaches(mapper_.process()); },
                  "The mapper " + mapper_.name() + " does not listen to " + topic.name() + ": " + what_to_do + ".");
}

void BagPlayer::send_static_transforms() {
  const tf2_msgs::TFMessage all = static_transforms_.take(ros::TIME_MAX);
  if (!all.transforms.empty()) tf_static_.publish(all);
}

void BagPlayer::send_transforms(const ros::Time& until) {
  const tf2_msgs::TFMessage all = transforms_.take(until);
  if (!all.transforms.empty()) tf_.publish(all);
}

void BagPlayer::send_camera_and_color(const ros::Time& stamp) {
  if (const auto camera = cameras_.take(stamp)) info_.publish(*camera);
  if (!color_) return;
  for (const rosbag::MessageInstance& image : colors_.take(stamp)) color_->publish(image);
}

void BagPlayer::send_depth(const rosbag::MessageInstance& message, const ros::Time& stamp) {
  set_clock(stamp);
  depth_.publish(message);
}

/// Never sets the clock back, although the stamps of some recordings go back.
void BagPlayer::set_clock(const ros::Time& stamp) {
  clock_time_ = std::max(clock_time_, stamp);
  rosgraph_msgs::Clock clock;
  clock.clock = clock_time_;
  clock_.publish(clock);
}

}  // namespace frontier_surfels::replay
