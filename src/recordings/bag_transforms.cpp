#include "recordings/bag_transforms.hpp"

#include <cmath>
#include <stdexcept>

#include "frontier_surfels/types.hpp"
#include "recordings/bag_topics.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels::replay {

using messages::strip_slash;

namespace {

constexpr double kQuaternionTolerance = 1e-2;

bool is_usable(const geometry_msgs::TransformStamped& transform) {
  const auto& t = transform.transform.translation;
  const auto& q = transform.transform.rotation;
  const double norm = Eigen::Quaterniond(q.w, q.x, q.y, q.z).norm();
  const bool finite = std::isfinite(t.x) && std::isfinite(t.y) && std::isfinite(t.z);
  const bool named = !transform.header.frame_id.empty() && !transform.child_frame_id.empty();
  return finite && named && transform.header.frame_id != transform.child_frame_id && std::abs(norm - 1) <= kQuaternionTolerance;
}

}  // namespace

void normalise(geometry_msgs::Quaternion& q) {
  const double norm = Eigen::Quaterniond(q.w, q.x, q.y, q.z).norm(), deviation = std::abs(norm - 1);
  const bool is_rounding = deviation < 1e-6;  // is left as it is
  if (is_rounding || !(deviation <= kQuaternionTolerance)) return;
  q.x /= norm;
  q.y /= norm;
  q.z /= norm;
  q.w /= norm;
}

/// Transforms are kept as long as possible: tf2 adds this duration to stamps, and ros::Time can just hold the sum.
BagTransforms::BagTransforms() : buffer_(ros::Duration(messages::kLatestTime, 0)) {}

void BagTransforms::add(const tf2_msgs::TFMessage& message, bool is_static) {
  for (geometry_msgs::TransformStamped transform : message.transforms) {
    transform.header.frame_id = strip_slash(transform.header.frame_id);
    transform.child_frame_id = strip_slash(transform.child_frame_id);
    if (!is_usable(transform) || !(is_static || is_believed(transform.header.stamp))) {
      ++damaged_;
      continue;
    }
    if (!is_static && !seen_.emplace(transform.child_frame_id, transform.header.stamp).second) continue;
    normalise(transform.transform.rotation);
    try {
      buffer_.setTransform(transform, "bag", is_static);
      parent_of_[transform.child_frame_id] = transform.header.frame_id;
    } catch (const std::runtime_error&) {  // whatever else tf2 refuses
      ++damaged_;
    }
  }
}

std::string BagTransforms::root_of(const std::string& frame) const {
  std::set<std::string> passed;  // a broken tree may have loops
  std::string root = frame;
  for (auto it = parent_of_.find(root); it != parent_of_.end() && passed.insert(root).second; it = parent_of_.find(root)) root = it->second;
  if (root == frame)
    throw Error("No transform in /tf or /tf_static has '" + frame + "' as its child; the transforms are: " + frames() + ".");
  return root;
}

bool BagTransforms::knows(const std::string& frame) const {
  if (parent_of_.count(frame)) return true;
  for (const auto& [child, parent] : parent_of_) {
    if (parent == frame) return true;
  }
  return false;
}

std::string BagTransforms::frames() const {
  std::string text;
  for (const auto& [child, parent] : parent_of_) text += (text.empty() ? "" : ", ") + parent + " -> " + child;
  return text.empty() ? "none" : text;
}

Eigen::Isometry3d BagTransforms::T_world_frame(const std::string& world, const std::string& frame, const ros::Time& stamp) const {
  if (stamp.isZero()) throw BadFrame("its stamp is 0, which is not a valid time");
  if (!is_believed(stamp)) throw BadFrame(messages::late_stamp(stamp));
  if (frame == world) throw BadFrame("its frame is the world frame '" + world + "' itself");
  try {
    return messages::to_isometry(buffer_.lookupTransform(world, frame, stamp).transform);
  } catch (const std::runtime_error& error) {  // of tf2, or of ros::Time
    throw BadFrame("its pose is not known (" + std::string(error.what()) + ")");
  }
}

}  // namespace frontier_surfels::replay
