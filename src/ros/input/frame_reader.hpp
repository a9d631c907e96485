/// What a depth image needs to be mapped: its pose, its camera, its colour.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "frontier_surfels/replay/recorded_frame.hpp"
#include "ros/input/frame_input.hpp"
#include "ros/input/frame_poses.hpp"

namespace frontier_surfels {

/// An image that cannot be mapped, and why.
struct DroppedFrame : BadFrame {
  /// @param result  one of FrameReport's
  DroppedFrame(std::uint8_t result, const std::string& sentence) : BadFrame(sentence), result(result) {}
  std::uint8_t result;
};

class FrameReader {
 public:
  /// @param stop  asked while waiting: whether to give up
  FrameReader(const NodeConfig& config, const FrameInput& input, const FramePoses& poses, std::function<bool()> stop);

  /// Waits for the pose at the image's stamp and its camera (at most tf_timeout) and for its colour, and unpacks everything.
  /// @throws DroppedFrame
  replay::RecordedFrame read(const messages::ImageMessage& image) const;

 private:
  void wait_for_the_rest(const std_msgs::Header& header, const cv::Size& image_size) const;
  bool has_camera(const std_msgs::Header& header, const cv::Size& image_size) const;
  Intrinsics camera_of(const std_msgs::Header& header, const cv::Size& image_size) const;
  cv::Mat color_of(const std_msgs::Header& header, const cv::Size& depth_size) const;

  const NodeConfig& config_;
  const FrameInput& input_;
  const FramePoses& poses_;
  std::function<bool()> stop_;
};

}  // namespace frontier_surfels
