/// A depth image of a recording with all that belongs to it.
#pragma once

#include <cmath>
#include <opencv2/core.hpp>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::replay {

/// A frame that owns its images. They are in this machine's byte order.
struct RecordedFrame {
  std::size_t index = 0;  ///< place in the recording, counted from 0
  double stamp = 0;       ///< [s]
  cv::Mat depth;          ///< CV_16UC1 [Config::depth_unit] or CV_32FC1 [m]
  cv::Mat color;          ///< CV_8UC3, BGR, registered to depth; empty where there is none
  Intrinsics intrinsics;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d(Eigen::Matrix4d::Constant(std::nan("")));  ///< optical frame

  /// A view of this frame, valid as long as the frame itself. @throws BadFrame if an image is of another type
  DepthFrame view() const;
};

inline DepthFrame RecordedFrame::view() const {
  if (depth.type() != CV_16UC1 && depth.type() != CV_32FC1)
    throw BadFrame("a depth image must have one channel of 16-bit mm or of 32-bit m");

  DepthFrame frame;
  frame.stamp = stamp;
  frame.intrinsics = intrinsics;
  frame.T_world_camera = T_world_camera;
  frame.depth.width = depth.cols;
  frame.depth.height = depth.rows;
  frame.depth.step = depth.step[0];
  frame.depth.encoding = depth.type() == CV_16UC1 ? DepthImage::Encoding::kStepsU16 : DepthImage::Encoding::kMetresF32;
  frame.depth.data = depth.data;
  if (color.empty()) return frame;

  if (color.type() != CV_8UC3) throw BadFrame("a colour image must have three channels of 8 bits");
  ColorImage view;
  view.width = color.cols;
  view.height = color.rows;
  view.step = color.step[0];
  view.order = ColorImage::Order::kBgr;
  view.data = color.data;
  frame.color = view;
  return frame;
}

}  // namespace frontier_surfels::replay
