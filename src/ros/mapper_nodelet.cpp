/// frontier_surfels/mapper: the mapper as a nodelet.
#include <nodelet/nodelet.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "ros/mapper_ros.hpp"

namespace frontier_surfels {

class MapperNodelet : public nodelet::Nodelet {
  void onInit() override {
    try {
      mapper_ = std::make_unique<MapperRos>(getNodeHandle(), getPrivateNodeHandle());
    } catch (const std::exception& error) {
      NODELET_FATAL("%s", error.what());
      throw;  // so that the manager reports that loading failed
    }
  }

  std::unique_ptr<MapperRos> mapper_;
};

}  // namespace frontier_surfels

PLUGINLIB_EXPORT_CLASS(frontier_surfels::MapperNodelet, nodelet::Nodelet)
