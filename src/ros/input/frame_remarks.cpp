#include "ros/input/frame_remarks.hpp"

#include <algorithm>

namespace frontier_surfels {
namespace {

constexpr double kStillDistance = 1e-4;       // [m], below the noise of any tracked pose
constexpr double kStillRotation = 1e-4;       // largest difference of a rotation matrix' elements
constexpr std::size_t kAlternatingSizes = 4;  // a camera whose mode is changed to and fro has fewer

DepthCensus sum_of(const std::deque<DepthCensus>& images) {
  DepthCensus sum;
  for (const DepthCensus& image : images) sum += image;
  return sum;
}

std::string size_text(const std::pair<int, int>& size) { return std::to_string(size.first) + "x" + std::to_string(size.second); }

}  // namespace

std::vector<std::string> CameraRemarks::on(const DepthImage& image, const sensor_msgs::CameraInfo& info) {
  std::vector<std::string> remarks;
  for (const std::string& remark : {about_distortion(info), about_size(image)})
    if (!remark.empty()) remarks.push_back(remark);
  return remarks;
}

std::string CameraRemarks::about_distortion(const sensor_msgs::CameraInfo& info) {
  const bool distorts = std::any_of(info.D.begin(), info.D.end(), [](double coefficient) { return coefficient != 0; });
  if (distortion_told_ || info.P[0] != 0 || !distorts) return {};
  distortion_told_ = true;
  return "The camera_info has distortion, but no P: the depth images are taken as rectified, with K. If they are not, " + choose_depth_ +
         " rectified ones, as those of image_proc, or calibrate the camera.";
}

std::string CameraRemarks::about_size(const DepthImage& image) {
  const std::pair<int, int> size(image.width, image.height);
  if (!sizes_.empty() && sizes_.back() == size) return {};
  sizes_.push_back(size);
  if (sizes_.size() > kAlternatingSizes) sizes_.pop_front();
  if (sizes_told_ || sizes_.size() < kAlternatingSizes || sizes_[0] != sizes_[2] || sizes_[1] != sizes_[3]) return {};
  sizes_told_ = true;
  return "Depth images of " + size_text(sizes_[0]) + " and of " + size_text(sizes_[1]) +
         " pixels alternate: do two cameras publish on the topic? " + choose_camera_;
}

std::string FrameRemarks::on(const DepthFrame& frame, std::size_t measured_pixels, const sensor_msgs::CameraInfo& info,
                             WarningThrottle::Clock::time_point now) {
  const DepthCensus depths = count_depths(frame.depth, config_, measured_pixels);
  std::string all = about_pixels(depths);
  if (!all.empty()) warn_of_pixels(all, now);
  std::vector<std::string> remarks = camera_remarks_.on(frame.depth, info);
  for (const std::string& remark : {about_far(depths), about_motion(frame.T_world_camera)})
    if (!remark.empty()) remarks.push_back(remark);
  for (const std::string& remark : remarks) {
    warn_(remark);
    all += (all.empty() ? "" : " ") + remark;
  }
  return all;
}

void FrameRemarks::warn_of_pixels(const std::string& sentence, WarningThrottle::Clock::time_point now) {
  if (pixel_warnings_.due(sentence, now) > 0) warn_(sentence);
}

std::string FrameRemarks::about_pixels(const DepthCensus& depths) {
  depths_.push_back(depths);
  if (depths_.size() > kDepthFrames) depths_.pop_front();
  if (depths.reason() == "no_agreement") return "The depth image has " + no_agreement(config_);
  if (depths.usable > 0)  // about_far() judges far depths that carve
    return depths_.size() < kDepthFrames || config_.carve_beyond_range ? std::string() : few_in_range(sum_of(depths_), config_);
  if (depths.measured() == 0)
    return "The depth image has no measurement in any pixel (0 or NaN): check that the camera delivers depth and is not covered, and that "
           "depth/image is remapped to the right topic.";
  if (depths.saturated == depths.measured())
    return "The depth image is 65535 in every pixel that is not 0, which means no measurement: check the camera and its driver.";
  return "The depth image has no depth from " + depth_range(config_) + ", only depths " + range_and_remedy(depths, config_);
}

/// With carve_beyond_range a camera may well look at nothing near for a while, so that many frames are judged together.
std::string FrameRemarks::about_far(const DepthCensus& depths) {
  if (!config_.carve_beyond_range || far_told_ || depths.usable == 0) return {};
  far_depths_ += depths;
  if (++far_frames_ < kFarFrames) return {};
  const std::string few = few_in_range(far_depths_, config_);
  far_depths_ = {};
  far_frames_ = 0;
  if (few.empty()) return {};
  far_told_ = true;
  return "In the last " + std::to_string(kFarFrames) + " frames: " + few;
}

std::string FrameRemarks::about_motion(const Eigen::Isometry3d& T_world_camera) {
  if (motion_told_) return {};
  if (!T_world_first_) T_world_first_ = T_world_camera;
  const bool still = (T_world_camera.translation() - T_world_first_->translation()).norm() <= kStillDistance &&
                     (T_world_camera.linear() - T_world_first_->linear()).cwiseAbs().maxCoeff() <= kStillRotation;
  moved_ = moved_ || !still;
  if (moved_ || ++still_frames_ < kStillFrames) return {};
  motion_told_ = true;
  return "The camera has not moved in " + std::to_string(kStillFrames) +
         " frames: if it did move, tf lacks the transform that moves. Publish it (odometry or localisation), or choose another "
         "~world_frame.";
}

void FrameRemarks::forget() {
  depths_.clear();
  camera_remarks_.forget();
  T_world_first_.reset();
  far_depths_ = {};
  far_frames_ = 0;
  still_frames_ = 0;
  moved_ = false;
}

}  // namespace frontier_surfels
