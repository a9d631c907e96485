/// A depth image on its way to the mapper: as it arrives, with everything that belongs to it, and as the mapper reads it.
#pragma once

#include <sensor_msgs/CameraInfo.h>

#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "frontier_surfels/types.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels {

using Clock = std::chrono::steady_clock;  // not ROS time, which stands still while a bag is paused

/// An image cannot be mapped; what() is the sentence that says why.
struct DroppedFrame : BadFrame {
  /// @param result  one of FrameReport's
  DroppedFrame(std::uint8_t result, const std::string& sentence) : BadFrame(sentence), result(result) {}
  std::uint8_t result;
};

/// A depth image as it arrives.
struct DepthArrival {
  messages::ImageMessage image;
  Clock::time_point time;
};

/// A depth image with everything that belongs to it.
struct CompleteImage {
  DepthArrival arrival;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d(Eigen::Matrix4d::Constant(std::nan("")));  ///< optical frame, at the image's stamp
  sensor_msgs::CameraInfoConstPtr info;
  messages::ImageMessage color;  ///< empty if there is none
};

/// A complete image as the mapper reads it. Pixels of raw messages are not copied: the messages are kept, and viewed.
class CameraFrame {
 public:
  /// Decodes compressed images. Colour that cannot be used is left out.
  /// @throws DroppedFrame if the depth image is damaged, or its camera_info does not fit
  explicit CameraFrame(const CompleteImage& image);

  /// Valid as long as this object.
  DepthFrame view() const;

  /// Why the colour image is not used, as a sentence; empty if it is, or if there is none.
  const std::string& color_fault() const { return color_fault_; }

 private:
  void take_color(const messages::ImageMessage& message);

  double stamp_;  ///< [s]
  messages::Pixels<DepthImage> depth_;
  std::optional<messages::Pixels<ColorImage>> color_;
  std::string color_fault_;
  Intrinsics intrinsics_;
  Eigen::Isometry3d T_world_camera_;
};

/// Checks a raw image's encoding, size and amount of data. Compressed images are checked when they are decoded.
/// @throws DroppedFrame
void check_depth(const messages::ImageMessage& image);

/// Checks whether `info` describes the camera of the image. The size of compressed images is checked when they are decoded.
/// @throws DroppedFrame
void check_camera(const messages::ImageMessage& image, const sensor_msgs::CameraInfo& info);

}  // namespace frontier_surfels
