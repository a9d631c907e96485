#include "ros/input/frame_poses.hpp"

#include <algorithm>
#include <sstream>

#include "frontier_surfels/types.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels {

using messages::strip_slash;

FramePoses::FramePoses(const std::string& world_frame) : world_frame_(strip_slash(world_frame)) {}

void FramePoses::start(const ros::NodeHandle& nh) { listener_.emplace(buffer_, nh); }

bool FramePoses::has(const std::string& frame, const ros::Time& stamp) const {
  const std::string camera = strip_slash(frame);
  // tf would answer the identity for the world frame itself, which is no camera's pose.
  return !camera.empty() && camera != world_frame_ && buffer_.canTransform(world_frame_, camera, stamp);
}

Eigen::Isometry3d FramePoses::T_world_frame(const std::string& frame, const ros::Time& stamp) const {
  if (!has(frame, stamp)) throw BadFrame(explain(frame, stamp));
  try {
    return messages::to_isometry(buffer_.lookupTransform(world_frame_, strip_slash(frame), stamp).transform);
  } catch (const std::exception& error) {
    throw BadFrame(error.what());
  }
}

/// Which transform is missing, or how old the newest one is.
std::string FramePoses::explain(const std::string& frame, const ros::Time& stamp) const {
  const std::string camera = strip_slash(frame), between = "from '" + camera + "' to '" + world_frame_ + "'";
  if (camera.empty()) return "the frame_id is empty";
  if (camera == world_frame_) return "the image's frame is the world frame '" + world_frame_ + "' itself: set ~world_frame";
  const ros::Time any;
  std::string why;
  if (!buffer_.canTransform(world_frame_, camera, any, &why)) {
    std::replace(why.begin(), why.end(), '\n', ' ');  // tf lists the frames of a loop, one a line
    return "tf has no transform " + between + " (" + why + "): check ~world_frame, the image's frame_id, and that tf is published";
  }

  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(3);
  try {
    const double ahead = messages::seconds(buffer_.lookupTransform(world_frame_, camera, any).header.stamp, stamp);
    text << "tf's newest transform " << between << " is " << std::abs(ahead) << " s " << (ahead > 0 ? "older" : "newer")
         << " than the image: "
         << (ahead > 0 ? "raise ~tf_timeout, or check the clocks of camera and tf" : "the image comes too late for tf's memory");
  } catch (const std::exception& error) {  // the transforms have been cleared meanwhile
    text << error.what();
  }
  return text.str();
}

void FramePoses::forget_future(const std::string& frame, const ros::Time& stamp) {
  constexpr double kFuture = 2;  // [s]; transforms that are less far ahead may be right, because a replay may send them ahead
  try {
    const ros::Time newest = buffer_.lookupTransform(world_frame_, strip_slash(frame), ros::Time()).header.stamp;
    if (messages::seconds(stamp, newest) > kFuture) buffer_.clear();
  } catch (const std::exception&) {  // there is nothing to forget
  }
}

}  // namespace frontier_surfels
