/// Poses of the camera from tf.
#pragma once

#include <ros/node_handle.h>
#include <tf2/buffer_core.h>
#include <tf2_ros/transform_listener.h>

#include <Eigen/Geometry>
#include <string>

namespace frontier_surfels {

/// Listens to tf and tf_static on a thread of its own. A pose is the one at its stamp, or none: never the identity, never the latest.
class FramePoses {
 public:
  FramePoses(const ros::NodeHandle& nh, std::string world_frame);

  /// Whether T_world_frame would answer now. @param why  otherwise, if not null: tf's reason
  bool has(const std::string& frame, const ros::Time& stamp, std::string* why = nullptr) const;

  /// @throws BadFrame if it is not known
  Eigen::Isometry3d T_world_frame(const std::string& frame, const ros::Time& stamp) const;

  /// Why it is not known, for people: which frames there are, or how old the newest transform is.
  std::string explain(const std::string& frame, const ros::Time& stamp) const;

  /// Time has jumped back to `stamp`: forgets transforms of the future. tf's own listener does so, too, but only if it sees /clock first.
  void forget_future(const std::string& frame, const ros::Time& stamp);

 private:
  std::string world_frame_;
  tf2::BufferCore buffer_;
  tf2_ros::TransformListener listener_;
};

}  // namespace frontier_surfels
