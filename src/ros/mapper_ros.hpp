/// The mapper with its ROS interface: the class that both the nodelet and the node contain.
#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace frontier_surfels {

/// Names of inputs are relative to `nh`; those of outputs, services and parameters to `pnh`. Callbacks in the queue of `nh` only store what
/// arrives. Separate threads look for what waiting images lack, map, publish, and answer services.
class MapperRos {
 public:
  /// Reads the parameters, builds the mapper and subscribes its inputs.
  /// @throws Error with every fault of the parameters, DeviceError
  MapperRos(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~MapperRos();  ///< as stop(), but a fault is only logged

  /// Stops mapping after the current frame, and writes the rest of the map to the map folder, if there is one.
  /// @throws FileError  it cannot be written
  void stop();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace frontier_surfels
