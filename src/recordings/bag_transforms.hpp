/// All transforms of a bag, so that poses are known at any time of it.
#pragma once

#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <Eigen/Geometry>
#include <map>
#include <set>
#include <string>
#include <utility>

namespace frontier_surfels::replay {

/// Scales a quaternion whose length is nearly 1 to length 1, because tf2 is stricter than recordings are. Leaves any other as it is.
void normalise(geometry_msgs::Quaternion& q);

/// Frame names in messages may have leading slashes, which are removed. Arguments have none.
class BagTransforms {
 public:
  BagTransforms();

  void add(const tf2_msgs::TFMessage& message, bool is_static);

  /// The root of the tf tree that contains `frame`. @throws Error if `frame` has no parent
  std::string root_of(const std::string& frame) const;

  /// Whether any transform names this frame.
  bool knows(const std::string& frame) const;

  /// A list of all transforms, for messages.
  std::string frames() const;

  /// Pose of `frame` in `world` at `stamp`. @throws BadFrame if it is not known
  Eigen::Isometry3d T_world_frame(const std::string& world, const std::string& frame, const ros::Time& stamp) const;

  /// Number of transforms that were left out because they are not finite, no rotations, without names, or stamped later than in
  /// 2038.
  std::size_t damaged() const { return damaged_; }

 private:
  tf2::BufferCore buffer_;
  std::map<std::string, std::string> parent_of_;
  std::set<std::pair<std::string, ros::Time>> seen_;  ///< child and stamp; repeated ones are left out: tf2 would print warnings
  std::size_t damaged_ = 0;
};

}  // namespace frontier_surfels::replay
