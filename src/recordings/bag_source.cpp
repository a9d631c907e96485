#include "recordings/bag_source.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "recordings/bag_check.hpp"

namespace frontier_surfels::replay {

using messages::kColorTolerance;
using messages::strip_slash;

namespace {

bool is_topic(const rosbag::ConnectionInfo& connection, const char* name) { return strip_slash(connection.topic) == name; }

/// Checks that the file is a bag. The messages are clearer than those of rosbag.
void check_is_bag(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string start(13, '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(file.gcount()));
  if (start.empty()) throw Error(path + " is empty or cannot be read: record or copy it again.");
  if (start.compare(0, 8, "#ROSBAG ") != 0) throw Error(path + " is not a bag of ROS 1: give a bag, or the folder of a recording.");
  if (start != "#ROSBAG V2.0\n") throw Error(path + " is a bag of an old format: convert it with `rosbag fix`.");
}

}  // namespace

ImageWindow::ImageWindow(const rosbag::Bag& bag, const std::string& topic)
    : view_(bag, [topic](const rosbag::ConnectionInfo* connection) { return connection->topic == topic; }), next_(view_.begin()) {}

ImageMessage ImageWindow::nearest(const ros::Time& stamp) {
  const auto offset = [&](const ImageMessage& image) { return messages::seconds(stamp, image.header().stamp); };
  while (next_ != view_.end() && (window_.empty() || offset(window_.back()) < kColorTolerance)) {
    const rosbag::MessageInstance message = *next_;
    ++next_;
    const ImageMessage image = to_image_message(message);
    if (image && is_believed(image.header().stamp)) window_.push_back(image);
    while (!window_.empty() && offset(window_.front()) < -kColorTolerance) window_.pop_front();
  }
  while (!window_.empty() && offset(window_.front()) < -kColorTolerance) window_.pop_front();

  const auto best = std::min_element(window_.begin(), window_.end(), [&](const ImageMessage& a, const ImageMessage& b) {
    return std::abs(offset(a)) < std::abs(offset(b));
  });
  return best != window_.end() && std::abs(offset(*best)) <= kColorTolerance ? *best : ImageMessage();
}

BagSource::BagSource(const std::string& path, const SourceOptions& options) {
  open(path);
  try {
    topics_ = find_topics(bag_, options);
    read_transforms_and_cameras();
    depth_view_ = std::make_unique<rosbag::View>(
        bag_, [this](const rosbag::ConnectionInfo* connection) { return connection->topic == topics_.depth; });
    selection_ = select_frames(options, depth_view_->size(), path);
    choose_world(options.world_frame);
    next_depth_ = std::next(depth_view_->begin(), static_cast<std::ptrdiff_t>(selection_.first));
    if (!topics_.color.empty()) color_images_ = std::make_unique<ImageWindow>(bag_, topics_.color);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {  // of rosbag, and std::bad_alloc because of damaged sizes
    throw Error(path + " is damaged (" + error.what() + "): repair it with `rosbag reindex`, or record it again.");
  }
  notes_.push_back("Depth is read from " + topics_.depth + ", the camera from " + topics_.info + ", colour from " +
                   (topics_.color.empty() ? "nowhere" : topics_.color) + ", poses in the frame " + world_ + ".");
}

void BagSource::open(const std::string& path) {
  check_is_bag(path);
  check_bag(path);
  try {
    bag_.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw Error(path + " was not closed properly and has no index: repair it with `rosbag reindex`.");
  } catch (const std::exception& error) {  // sizes in damaged files reach std::bad_alloc
    throw Error(path + " is damaged (" + error.what() + "): repair it with `rosbag reindex`, or copy it again.");
  }
}

void BagSource::read_transforms_and_cameras() {
  rosbag::View view(bag_, [this](const rosbag::ConnectionInfo* connection) {
    return is_topic(*connection, "tf") || is_topic(*connection, "tf_static") || connection->topic == topics_.info;
  });
  std::size_t unreadable = 0;
  for (const rosbag::MessageInstance& message : view) {
    try {
      read_transforms_or_camera(message);
    } catch (const std::exception&) {  // of rosbag, and std::bad_alloc because of damaged sizes
      ++unreadable;
    }
  }
  if (unreadable > 0) notes_.push_back(std::to_string(unreadable) + " damaged messages with transforms or cameras are left out.");
  if (cameras_.empty())
    throw Error(bag_.getFileName() + " has no message on " + topics_.info +
                ", so that the camera's intrinsics are unknown: choose another topic with --info-topic.");
  const auto by_stamp = [](const auto& a, const auto& b) { return a.first < b.first; };
  const auto same_camera = [](const auto& a, const auto& b) { return a.second == b.second; };
  std::stable_sort(cameras_.begin(), cameras_.end(), by_stamp);
  cameras_.erase(std::unique(cameras_.begin(), cameras_.end(), same_camera), cameras_.end());
  if (transforms_.damaged() > 0) {
    notes_.push_back(
        std::to_string(transforms_.damaged()) +
        " transforms of the bag are left out, because they are not finite, no rotations, without names, or stamped later than in 2038.");
  }
}

void BagSource::read_transforms_or_camera(const rosbag::MessageInstance& message) {
  if (const auto transforms = message.instantiate<tf2_msgs::TFMessage>()) {
    transforms_.add(*transforms, strip_slash(message.getTopic()) == "tf_static");
  } else if (const auto info = message.instantiate<sensor_msgs::CameraInfo>()) {
    cameras_.emplace_back(info->header.stamp, *info);
    cameras_.back().second.header = std_msgs::Header();  // so that only the cameras themselves are compared
  }
}

/// Chooses the world frame. A bag without transforms to it is refused here, with a list of the transforms that exist.
void BagSource::choose_world(const std::string& wanted) {
  const ImageMessage first = to_image_message(*depth_view_->begin());
  if (!first) throw Error(bag_.getFileName() + " has no images on " + topics_.depth + ".");
  const std::string camera = strip_slash(first.header().frame_id);
  world_ = strip_slash(wanted);
  if (world_.empty() && camera.empty())
    throw Error("The frame_id of the first image on " + topics_.depth +
                " is empty: its driver must set it to the camera's optical frame; choose another topic with --depth-topic.");
  if (world_.empty()) world_ = transforms_.root_of(camera);
  if (world_ == camera)
    throw Error("The world frame '" + world_ +
                "' is the frame of the depth images themselves: choose the frame in which the camera moves.");
  if (!transforms_.knows(world_)) {
    throw Error(bag_.getFileName() + " has no transform with the frame '" + world_ + "'; its transforms are: " + transforms_.frames() +
                ".");
  }
}

std::optional<RecordedFrame> BagSource::next() {
  while (done_ < selection_.count) {
    const rosbag::MessageInstance& message = message_.emplace(*next_depth_);
    const std::size_t index = selection_.first + done_ * selection_.stride;
    if (++done_ < selection_.count) std::advance(next_depth_, static_cast<std::ptrdiff_t>(selection_.stride));
    const std::string frame = "Frame " + std::to_string(index) + " of " + topics_.depth + " is skipped: ";
    try {
      RecordedFrame recorded = read(message);
      recorded.index = index;
      return recorded;
    } catch (const BadFrame& fault) {
      skipped_.push_back(frame + fault.what() + ".");
    } catch (const std::exception& fault) {  // of rosbag, and std::bad_alloc because of damaged sizes
      skipped_.push_back(frame + "the bag is damaged there (" + fault.what() + ").");
    }
  }
  return std::nullopt;
}

RecordedFrame BagSource::read(const rosbag::MessageInstance& message) {
  const ImageMessage image = to_image_message(message);
  if (!image) throw BadFrame("it is a " + message.getDataType());
  const std_msgs::Header& header = image.header();

  const std::string camera = strip_slash(header.frame_id);
  if (camera.empty()) throw BadFrame("its frame_id is empty: its driver must set it to the camera's optical frame");

  RecordedFrame frame;
  frame.stamp = header.stamp.toSec();
  frame.T_world_camera = transforms_.T_world_frame(world_, camera, header.stamp);
  frame.depth = messages::copy(messages::depth_pixels(image).view);
  const sensor_msgs::CameraInfo& info = camera_at(header.stamp);
  frame.intrinsics = messages::to_intrinsics(info, frame.depth.size());
  if (color_images_) frame.color = color_at(header.stamp, frame.depth.size());
  for (std::string& remark : remarks_.on(frame.view().depth, info)) warnings_.push_back(std::move(remark));
  return frame;
}

/// The latest camera_info at or before the stamp, or of the first one if there is none.
const sensor_msgs::CameraInfo& BagSource::camera_at(const ros::Time& stamp) const {
  auto camera = std::upper_bound(cameras_.begin(), cameras_.end(), stamp,
                                 [](const ros::Time& value, const auto& element) { return value < element.first; });
  if (camera != cameras_.begin()) --camera;
  return camera->second;
}

/// The colour image of a frame, or an empty one. A fault of a colour image never drops a frame.
cv::Mat BagSource::color_at(const ros::Time& stamp, const cv::Size& depth_size) {
  const std::string without = ": their frames are used without colour.";
  try {
    const ImageMessage image = color_images_->nearest(stamp);
    if (!image) {
      note_once("Some depth images have no image on " + topics_.color + " within 30 ms" + without);
      return {};
    }
    const messages::Pixels<ColorImage> color = messages::color_pixels(image);
    if (cv::Size(color.view.width, color.view.height) == depth_size) return messages::copy(color.view);
    note_once("Some images on " + topics_.color + " have another size than the depth image" + without);
  } catch (const std::exception& fault) {  // BadFrame, rosbag's, or std::bad_alloc because of damaged sizes
    note_once("Some images on " + topics_.color + " cannot be read (" + fault.what() + ")" + without);
  }
  return {};
}

std::string BagSource::if_still() const {
  return "record the transform that moves on /tf, or choose another frame with --world-frame; the bag's transforms are: " +
         transforms_.frames();
}

void BagSource::note_once(const std::string& sentence) {
  if (std::find(notes_.begin(), notes_.end(), sentence) == notes_.end()) notes_.push_back(sentence);
}

}  // namespace frontier_surfels::replay
