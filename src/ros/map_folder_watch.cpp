#include "ros/map_folder_watch.hpp"

#include <ros/console.h>

#include <exception>

#include "frontier_surfels/config.hpp"

namespace frontier_surfels {

std::string MapFolderWatch::look(Throttle::Clock::time_point now) {
  for (const std::string& warning : mapper_.take_warnings()) ROS_WARN("%s", warning.c_str());
  std::string fault = mapper_.map_folder_fault();
  if (!fault.empty() && tries_.is_due(now)) {
    try {
      mapper_.flush();
    } catch (const std::exception&) {  // the mapper still tells why
    }
    fault = mapper_.map_folder_fault();
  }
  if (fault == logged_) return fault;
  if (fault.empty())
    ROS_INFO("The map folder %s can be written again, and nothing is missing in it.", mapper_.config().map_folder.c_str());
  else
    ROS_ERROR("%s", fault.c_str());
  logged_ = fault;
  return fault;
}

}  // namespace frontier_surfels
