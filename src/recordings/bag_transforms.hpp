/// All transforms of a bag, for poses at any of its times.
#pragma once

#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <Eigen/Geometry>
#include <map>
#include <set>
#include <string>
#include <utility>

namespace frontier_surfels::replay {

/// Corrects a length that is nearly 1: tf2 itself accepts less of a deviation. Anything else is left as it is.
void normalise(geometry_msgs::Quaternion& q);

/// Frame names may have leading slashes everywhere; tf2 never sees them.
class BagTransforms {
 public:
  BagTransforms();

  void add(const tf2_msgs::TFMessage& message, bool is_static);

  /// The frame above all others that `frame` hangs on. @throws Error if `frame` hangs on none
  std::string root_of(const std::string& frame) const;

  /// Whether any transform names this frame.
  bool knows(const std::string& frame) const;

  /// All frames, for people.
  std::string frames() const;

  /// Pose of `frame` in `world` at `stamp`. @throws BadFrame if it is not known
  Eigen::Isometry3d T_world_frame(const std::string& world, const std::string& frame, const ros::Time& stamp) const;

  /// Transforms that were left out, as they are not finite, no rotation, or without names.
  std::size_t damaged() const { return damaged_; }

 private:
  tf2::BufferCore buffer_;
  std::map<std::string, std::string> parent_of_;
  std::set<std::pair<std::string, ros::Time>> seen_;  ///< child and stamp: tf2 prints a warning for each one that is repeated
  std::size_t damaged_ = 0;
};

}  // namespace frontier_surfels::replay
