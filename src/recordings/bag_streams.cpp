#include "recordings/bag_streams.hpp"

#include <algorithm>
#include <iterator>

#include "recordings/bag_topics.hpp"
#include "recordings/bag_transforms.hpp"

namespace frontier_surfels::replay {

using messages::strip_slash;

namespace {

std::function<bool(const std::string&)> is_exactly(const std::string& wanted) {
  return [wanted](const std::string& topic) { return topic == wanted; };
}

}  // namespace

BagStream::BagStream(const rosbag::Bag& bag, const std::function<bool(const std::string&)>& is_wanted)
    : view_(bag, [is_wanted](const rosbag::ConnectionInfo* connection) { return is_wanted(connection->topic); }), next_(view_.begin()) {}

rosbag::MessageInstance BagStream::take() {
  const rosbag::MessageInstance message = *next_;
  ++next_;
  return message;
}

TransformStream::TransformStream(const rosbag::Bag& bag, const std::string& topic)
    : messages_(bag, [topic](const std::string& name) { return strip_slash(name) == strip_slash(topic); }),
      is_static_(strip_slash(topic) == "tf_static") {}

tf2_msgs::TFMessage TransformStream::take(const ros::Time& until) {
  tf2_msgs::TFMessage all;
  while (!messages_.at_end() && messages_.peek().getTime() <= until) {
    const auto message = messages_.take().instantiate<tf2_msgs::TFMessage>();
    if (!message) continue;
    std::copy_if(message->transforms.begin(), message->transforms.end(), std::back_inserter(all.transforms),
                 [this](const geometry_msgs::TransformStamped& transform) { return is_static_ || is_believed(transform.header.stamp); });
  }
  for (geometry_msgs::TransformStamped& transform : all.transforms) normalise(transform.transform.rotation);  // as BagTransforms does
  return all;
}

CameraStream::CameraStream(const rosbag::Bag& bag, const std::string& topic) : messages_(bag, is_exactly(topic)) {}

std::optional<rosbag::MessageInstance> CameraStream::take(const ros::Time& stamp) {
  std::optional<rosbag::MessageInstance> camera;
  while (!messages_.at_end()) {
    const auto info = messages_.peek().instantiate<sensor_msgs::CameraInfo>();
    const bool is_believed_info = info && is_believed(info->header.stamp);
    if (is_believed_info && is_known_ && info->header.stamp > stamp) break;
    const rosbag::MessageInstance message = messages_.take();
    if (!info || (is_known_ && !is_believed_info)) continue;
    camera.emplace(message);
    is_known_ = true;
  }
  return camera;
}

ColorStream::ColorStream(const rosbag::Bag& bag, const std::string& topic) : messages_(bag, is_exactly(topic)) {}

std::vector<rosbag::MessageInstance> ColorStream::take(const ros::Time& stamp) {
  std::optional<rosbag::MessageInstance> before, after;
  while (known_until_ < stamp && !messages_.at_end()) {
    const rosbag::MessageInstance message = messages_.take();
    ImageMessage image;
    try {
      image = to_image_message(message);
    } catch (const ros::Exception&) {  // a damaged colour image never drops a frame
    }
    if (!image || !is_believed(image.header().stamp)) continue;
    known_until_ = image.header().stamp;
    (known_until_ < stamp ? before : after).emplace(message);
  }
  std::vector<rosbag::MessageInstance> images;
  for (const auto& image : {before, after})
    if (image) images.push_back(*image);
  return images;
}

}  // namespace frontier_surfels::replay
