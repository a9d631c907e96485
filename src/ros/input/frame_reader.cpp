#include "ros/input/frame_reader.hpp"

#include <frontier_surfels/FrameReport.h>
#include <ros/console.h>

#include <thread>

namespace frontier_surfels {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(1);
constexpr auto kColorWait = std::chrono::milliseconds(30);  // colour is an extra: a frame waits a camera's period for it, no more

/// Runs a conversion; what it throws becomes the reason to drop the frame.
template <typename Work>
auto or_drop(std::uint8_t result, const std::string& what, Work work) -> decltype(work()) {
  try {
    return work();
  } catch (const BadFrame& fault) {
    throw DroppedFrame(result, what + fault.what() + ".");
  }
}

}  // namespace

FrameReader::FrameReader(const NodeConfig& config, const FrameInput& input, const FramePoses& poses, std::function<bool()> stop)
    : config_(config), input_(input), poses_(poses), stop_(std::move(stop)) {}

replay::RecordedFrame FrameReader::read(const messages::ImageMessage& image) const {
  const std_msgs::Header& header = image.header();
  if (header.stamp.isZero()) {
    throw DroppedFrame(FrameReport::DROPPED_NO_POSE, "The image's stamp is 0, which is no time: its driver must set it.");
  }
  replay::RecordedFrame frame;
  frame.stamp = header.stamp.toSec();
  frame.depth = or_drop(FrameReport::DROPPED_BAD_IMAGE, "The depth image cannot be used: ", [&] { return messages::depth_image(image); });
  wait_for_the_rest(header, frame.depth.size());
  frame.intrinsics = camera_of(header, frame.depth.size());
  if (!poses_.has(header.frame_id, header.stamp)) {
    throw DroppedFrame(FrameReport::DROPPED_NO_POSE,
                       "The pose at the image's stamp is not known: " + poses_.explain(header.frame_id, header.stamp) + ".");
  }
  frame.T_world_camera = or_drop(FrameReport::DROPPED_NO_POSE, "The pose at the image's stamp is not known: ", [&] {
    return poses_.T_world_frame(header.frame_id, header.stamp);
  });
  frame.color = color_of(header, frame.depth.size());
  return frame;
}

/// They come over other connections than the image, and may be a little later.
void FrameReader::wait_for_the_rest(const std_msgs::Header& header, const cv::Size& image_size) const {
  const auto start = Clock::now();
  const auto timeout = std::chrono::duration<double>(config_.tf_timeout);
  const auto is_missing = [&] { return !has_camera(header, image_size) || !poses_.has(header.frame_id, header.stamp); };
  while (is_missing() && Clock::now() - start < timeout && !stop_()) std::this_thread::sleep_for(kPoll);
  while (config_.use_color && Clock::now() - start < kColorWait && input_.color_is_due(header.stamp) && !stop_()) {
    std::this_thread::sleep_for(kPoll);
  }
}

bool FrameReader::has_camera(const std_msgs::Header& header, const cv::Size& image_size) const {
  try {
    camera_of(header, image_size);
    return true;
  } catch (const DroppedFrame&) {
    return false;
  }
}

Intrinsics FrameReader::camera_of(const std_msgs::Header& header, const cv::Size& image_size) const {
  const auto info = input_.camera_info(header.stamp);
  if (!info) {
    throw DroppedFrame(FrameReport::DROPPED_NO_CAMERA,
                       "No camera_info has come on " + input_.info_topic() + ": remap depth/camera_info to the depth camera's.");
  }
  return or_drop(FrameReport::DROPPED_NO_CAMERA,
                 "The camera of the depth image is not known: ", [&] { return messages::to_intrinsics(*info, image_size); });
}

/// What is wrong with colour costs no frame.
cv::Mat FrameReader::color_of(const std_msgs::Header& header, const cv::Size& depth_size) const {
  const messages::ImageMessage image = input_.color_near(header.stamp);
  if (!image) return {};
  try {
    const cv::Mat color = messages::color_image(image);
    if (color.size() == depth_size) return color;
    ROS_WARN_THROTTLE(10,
                      "Colour images are not used: they are %dx%d pixels, the depth images %dx%d; remap color/image to one that is "
                      "registered to depth.",
                      color.cols, color.rows, depth_size.width, depth_size.height);
  } catch (const BadFrame& fault) {
    ROS_WARN_THROTTLE(10, "A colour image is not used: %s.", fault.what());
  }
  return {};
}

}  // namespace frontier_surfels
