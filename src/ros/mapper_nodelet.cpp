/// frontier_surfels/mapper: the mapper as a nodelet.
#include <nodelet/nodelet.h>

#include <algorithm>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "ros/arguments.hpp"
#include "ros/mapper_ros.hpp"

namespace frontier_surfels {

class MapperNodelet : public nodelet::Nodelet {
  void onInit() override {
    try {
      std::vector<std::string> arguments = getMyArgv();
      arguments.erase(std::remove(arguments.begin(), arguments.end(), "--no-bond"), arguments.end());  // `nodelet standalone` leaves it in
      if (const std::string fault = fault_of_arguments(arguments); !fault.empty()) throw Error(fault);
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
