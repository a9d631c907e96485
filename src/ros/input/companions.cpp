#include "ros/input/companions.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

constexpr std::size_t kMostInfos = 16;
constexpr std::size_t kMostColors = 40;  // more than a second of a camera, because a replay may send colour ahead
constexpr auto kLately = std::chrono::seconds(1);
constexpr double kFuture = 2;  // [s]; colour that is less far ahead may be right, because a replay may send it ahead

bool same_camera(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b) {
  sensor_msgs::CameraInfo with_header_of_b = a;
  with_header_of_b.header = b.header;
  return with_header_of_b == b;
}

/// How much later than `stamp` the image was taken [s].
double offset(const messages::ImageMessage& image, const ros::Time& stamp) { return messages::seconds(stamp, image.header().stamp); }

}  // namespace

bool CameraInfos::add(const sensor_msgs::CameraInfoConstPtr& info) {
  if (!infos_.empty() && same_camera(*info, *infos_.back())) return true;
  const bool is_believed = messages::is_believed(info->header.stamp);
  if (!infos_.empty() && !is_believed) return false;
  if (is_believed && !infos_.empty() && !messages::is_believed(infos_.front()->header.stamp)) infos_.clear();
  infos_.push_back(info);
  if (infos_.size() > kMostInfos) infos_.pop_front();
  return true;
}

sensor_msgs::CameraInfoConstPtr CameraInfos::at(const ros::Time& stamp) const {
  sensor_msgs::CameraInfoConstPtr found = infos_.empty() ? nullptr : infos_.front();
  for (const auto& info : infos_) {
    if (info->header.stamp <= stamp) found = info;
  }
  return found;
}

void CameraInfos::keep_last() {
  if (infos_.size() > 1) infos_.erase(infos_.begin(), infos_.end() - 1);
}

bool ColorImages::add(const messages::ImageMessage& image, Clock::time_point now) {
  if (!messages::is_believed(image.header().stamp)) return false;
  last_arrival_ = now;
  images_.push_back(image);
  if (images_.size() > kMostColors) images_.pop_front();
  return true;
}

messages::ImageMessage ColorImages::nearest(const ros::Time& stamp) const {
  const auto best = std::min_element(images_.begin(), images_.end(),
                                     [&](const auto& a, const auto& b) { return std::abs(offset(a, stamp)) < std::abs(offset(b, stamp)); });
  return best != images_.end() && std::abs(offset(*best, stamp)) <= messages::kColorTolerance ? *best : messages::ImageMessage();
}

bool ColorImages::is_due(const ros::Time& stamp, Clock::time_point now) const {
  return !images_.empty() && now - last_arrival_ < kLately && images_.back().header().stamp < stamp;
}

void ColorImages::forget_future(const ros::Time& stamp) {
  const auto is_future = [&](const messages::ImageMessage& image) { return offset(image, stamp) > kFuture; };
  images_.erase(std::remove_if(images_.begin(), images_.end(), is_future), images_.end());
}

}  // namespace frontier_surfels
