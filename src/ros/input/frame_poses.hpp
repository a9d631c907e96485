/// Poses of cameras from tf.
#pragma once

#include <ros/node_handle.h>
#include <tf2/buffer_core.h>

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "ros/input/transform_listener.hpp"

namespace frontier_surfels {

/// Transforms of tf and tf_static. A pose is the one at its stamp: never the identity, and never the latest one instead. Frames may be
/// named with leading slashes. All functions may be called from any thread.
class FramePoses {
 public:
  explicit FramePoses(const std::string& world_frame);

  /// Listens to tf and tf_static on a thread of its own.
  void start(const ros::NodeHandle& nh);

  /// Where the transforms are kept.
  tf2::BufferCore& buffer() { return buffer_; }

  /// Whether the pose at this stamp is known now.
  bool has(const std::string& frame, const ros::Time& stamp) const;

  /// The pose of `frame` in the world frame. @throws BadFrame if it is not known, with the reason
  Eigen::Isometry3d T_world_frame(const std::string& frame, const ros::Time& stamp) const;

  /// Time has jumped back to `stamp`: transforms of later times are forgotten. tf's own listener forgets them only if it receives /clock
  /// before the new transforms.
  void forget_future(const std::string& frame, const ros::Time& stamp);

 private:
  std::string explain(const std::string& frame, const ros::Time& stamp) const;

  const std::string world_frame_;
  tf2::BufferCore buffer_;
  std::optional<TransformListener> listener_;
};

}  // namespace frontier_surfels
