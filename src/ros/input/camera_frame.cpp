#include "ros/input/camera_frame.hpp"

#include <frontier_surfels/FrameReport.h>

namespace frontier_surfels {
namespace {

/// Runs a conversion. If it fails, the image is dropped for that reason.
template <typename Convert>
auto or_drop(std::uint8_t result, const std::string& what, Convert convert) -> decltype(convert()) {
  try {
    return convert();
  } catch (const BadFrame& fault) {
    throw DroppedFrame(result, what + fault.what() + ".");
  }
}

messages::Pixels<DepthImage> depth_of(const messages::ImageMessage& image) {
  return or_drop(FrameReport::DROPPED_BAD_IMAGE, "The depth image cannot be used: ", [&] { return messages::depth_pixels(image); });
}

/// @param size  of the image, if it is known
Intrinsics camera_of(const sensor_msgs::CameraInfo& info, const std::optional<cv::Size>& size) {
  return or_drop(FrameReport::DROPPED_NO_CAMERA, "The camera of the depth image is not known: ", [&] {
    return size ? messages::to_intrinsics(info, *size) : messages::to_intrinsics(info);
  });
}

std::string text_of(const cv::Size& size) { return std::to_string(size.width) + "x" + std::to_string(size.height); }

}  // namespace

CameraFrame::CameraFrame(const CompleteImage& image)
    : stamp_(image.arrival.image.header().stamp.toSec()),
      depth_(depth_of(image.arrival.image)),
      intrinsics_(camera_of(*image.info, cv::Size(depth_.view.width, depth_.view.height))),
      T_world_camera_(image.T_world_camera) {
  if (image.color) take_color(image.color);
}

void CameraFrame::take_color(const messages::ImageMessage& message) {
  try {
    const messages::Pixels<ColorImage> color = messages::color_pixels(message);
    const cv::Size size(color.view.width, color.view.height), depth_size(depth_.view.width, depth_.view.height);
    if (size == depth_size)
      color_ = color;
    else
      color_fault_ = "Colour images are not used: they are " + text_of(size) + " pixels, the depth images " + text_of(depth_size) +
                     "; remap color/image to one that is registered to depth.";
  } catch (const BadFrame& fault) {
    color_fault_ = std::string("A colour image is not used: ") + fault.what() + ".";
  }
}

DepthFrame CameraFrame::view() const {
  DepthFrame frame;
  frame.stamp = stamp_;
  frame.depth = depth_.view;
  frame.intrinsics = intrinsics_;
  frame.T_world_camera = T_world_camera_;
  if (color_) frame.color = color_->view;
  return frame;
}

void check_depth(const messages::ImageMessage& image) {
  if (image.raw) depth_of(image);
}

void check_camera(const messages::ImageMessage& image, const sensor_msgs::CameraInfo& info) {
  camera_of(info, messages::stated_size(image));
}

}  // namespace frontier_surfels
