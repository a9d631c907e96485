#include "recordings/bag_topics.hpp"

#include <rosbag/query.h>
#include <rosbag/view.h>

#include <algorithm>
#include <map>
#include <vector>

namespace frontier_surfels::replay {

using messages::strip_slash;

namespace {

constexpr const char* kInfoType = "sensor_msgs/CameraInfo";

struct ImageTopic {
  std::string name;
  bool compressed = false;
  bool is_depth = false;
  cv::Size size;
};

/// "/camera/depth/image/compressedDepth" -> "/camera/depth/image": the image without its transport.
std::string base_name(const ImageTopic& topic) {
  const std::size_t slash = topic.name.rfind('/');
  const bool transport = topic.compressed && slash != std::string::npos && topic.name.compare(slash + 1, 10, "compressed") == 0;
  return transport ? topic.name.substr(0, slash) : topic.name;
}

bool name_has(const std::string& name, std::initializer_list<const char*> parts) {
  std::string lower = name;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return std::any_of(parts.begin(), parts.end(), [&](const char* part) { return lower.find(part) != std::string::npos; });
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

std::vector<std::string> names_of(const std::vector<ImageTopic>& topics) {
  std::vector<std::string> names;
  for (const ImageTopic& topic : topics) names.push_back(topic.name);
  return names;
}

template <typename View>
cv::Size size_of(const View& image) {
  return cv::Size(image.width, image.height);
}

/// What an image message shows; empty if it cannot be used. @param fault  set to the reason why it is no depth image
std::optional<ImageTopic> look_at(const std::string& name, const ImageMessage& message, std::string& fault) {
  if (!message) return std::nullopt;
  const bool compressed = static_cast<bool>(message.compressed);
  try {
    return ImageTopic{name, compressed, true, size_of(messages::depth_pixels(message).view)};
  } catch (const BadFrame& bad) {  // no depth image, but perhaps a colour image
    fault = bad.what();
  }
  try {
    return ImageTopic{name, compressed, false, size_of(messages::color_pixels(message).view)};
  } catch (const BadFrame&) {
    return std::nullopt;
  }
}

/// Looks at the first message of a topic, or at the next ones if it is damaged.
std::optional<ImageTopic> look_at(const rosbag::Bag& bag, const std::string& name, std::string& fault) {
  rosbag::View view(bag, rosbag::TopicQuery(name));
  int tries = 10;
  for (auto it = view.begin(); it != view.end() && tries > 0; ++it, --tries) {
    if (const std::optional<ImageTopic> topic = look_at(name, to_image_message(*it), fault)) return topic;
  }
  return std::nullopt;
}

/// Keeps only the topics that satisfy `wanted`, unless there are none.
template <typename Predicate>
void prefer(std::vector<ImageTopic>& topics, Predicate wanted) {
  if (std::none_of(topics.begin(), topics.end(), wanted)) return;
  topics.erase(std::remove_if(topics.begin(), topics.end(), [&](const ImageTopic& topic) { return !wanted(topic); }), topics.end());
}

/// Drops compressed topics whose raw images are in the bag as well.
void drop_duplicates(std::vector<ImageTopic>& topics) {
  const std::vector<ImageTopic> all = topics;
  prefer(topics, [&](const ImageTopic& topic) {
    return std::none_of(all.begin(), all.end(), [&](const ImageTopic& other) {
      return topic.compressed && !other.compressed && base_name(other) == base_name(topic);
    });
  });
}

class Finder {
 public:
  explicit Finder(const rosbag::Bag& bag) : bag_(bag) {
    rosbag::View view(bag);
    for (const rosbag::ConnectionInfo* connection : view.getConnections()) types_[connection->topic] = connection->datatype;
    for (const auto& [name, type] : types_) {
      if (type != "sensor_msgs/Image" && type != "sensor_msgs/CompressedImage") continue;
      std::string fault;
      if (const std::optional<ImageTopic> image = look_at(bag, name, fault)) {
        images_.push_back(*image);
      } else if (!fault.empty()) {
        unusable_ += " The images of " + name + " cannot be used: " + fault + ".";
      }
    }
  }

  ImageTopic depth(const std::string& wanted) const {
    if (!wanted.empty()) return named(wanted, "depth");
    std::vector<ImageTopic> found;
    std::copy_if(images_.begin(), images_.end(), std::back_inserter(found), [](const ImageTopic& topic) { return topic.is_depth; });
    prefer(found, [](const ImageTopic& topic) { return name_has(topic.name, {"depth"}); });
    drop_duplicates(found);
    if (found.empty()) {
      throw Error(bag_.getFileName() + " has no depth images (16UC1, mono16, 32FC1, 16-bit PNG); its image topics are: " +
                  listed(names_of(images_)) + "." + unusable_);
    }
    if (found.size() > 1) throw_ambiguous("depth", names_of(found));
    return found.front();
  }

  std::string info(const std::string& wanted, const ImageTopic& depth) const {
    const std::string base = base_name(depth);
    const std::string beside = base.substr(0, base.rfind('/') + 1) + "camera_info";
    const std::string name = wanted.empty() ? beside : wanted;
    std::vector<std::string> candidates;
    for (const auto& [topic, type] : types_) {
      if (type != kInfoType) continue;
      if (strip_slash(topic) == strip_slash(name)) return topic;
      candidates.push_back(topic);
    }
    throw Error(bag_.getFileName() + " has no " + kInfoType + " on " + name +
                "; choose the topic with --info-topic; the candidates are: " + listed(candidates) + ".");
  }

  std::string color(const std::string& wanted, const ImageTopic& depth) const {
    if (wanted == "none") return {};
    if (!wanted.empty()) return named(wanted, "colour").name;
    std::vector<ImageTopic> found;
    std::copy_if(images_.begin(), images_.end(), std::back_inserter(found), [&](const ImageTopic& topic) {
      return !topic.is_depth && topic.size == depth.size && name_has(topic.name, {"regist", "rgb", "color", "colour"});
    });
    prefer(found, [](const ImageTopic& topic) { return name_has(topic.name, {"regist"}); });
    drop_duplicates(found);
    if (found.size() > 1) throw_ambiguous("color", names_of(found));
    return found.empty() ? std::string() : found.front().name;
  }

 private:
  ImageTopic named(const std::string& wanted, const char* what) const {
    for (const ImageTopic& topic : images_) {
      if (strip_slash(topic.name) == strip_slash(wanted)) return topic;
    }
    throw Error(bag_.getFileName() + " has no " + what + " images on " + wanted + "; its image topics are: " + listed(names_of(images_)) +
                "." + unusable_);
  }

  [[noreturn]] void throw_ambiguous(const std::string& what, const std::vector<std::string>& names) const {
    throw Error(bag_.getFileName() + " has several topics with " + what + " images: choose one with --" + what +
                "-topic: " + listed(names) + ".");
  }

  const rosbag::Bag& bag_;
  std::map<std::string, std::string> types_;  ///< of all topics
  std::vector<ImageTopic> images_;            ///< those that can be read
  std::string unusable_;                      ///< sentences about the others
};

}  // namespace

BagTopics find_topics(const rosbag::Bag& bag, const SourceOptions& options) {
  const Finder finder(bag);
  const ImageTopic depth = finder.depth(options.depth_topic);
  return {depth.name, finder.info(options.info_topic, depth), finder.color(options.color_topic, depth)};
}

ImageMessage to_image_message(const rosbag::MessageInstance& message) {
  return {message.instantiate<sensor_msgs::Image>(), message.instantiate<sensor_msgs::CompressedImage>()};
}

}  // namespace frontier_surfels::replay
