/// The mapper among ROS nodes: one class behind the nodelet and the node.
#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace frontier_surfels {

/// Inputs are relative to `nh`, outputs, services and parameters to `pnh`. Callbacks of `nh`'s queue only store what arrives; a thread of
/// its own maps, another one publishes, a third one answers services.
class MapperRos {
 public:
  /// Reads the parameters, builds the mapper, subscribes.
  /// @throws Error  with every fault of the parameters; DeviceError
  MapperRos(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~MapperRos();  ///< ends after the frame that is being mapped

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace frontier_surfels
