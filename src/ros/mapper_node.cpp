/// mapper_node: the mapper as a node.
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>

#include <algorithm>
#include <iostream>
#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "ros/arguments.hpp"
#include "ros/input/parameter_table.hpp"
#include "ros/mapper_ros.hpp"

namespace {

constexpr char kHelp[] = R"(Maps the boundary of known space from depth images with known poses.

usage: rosrun frontier_surfels mapper_node [TOPIC:=OTHER_TOPIC ...] [_PARAMETER:=VALUE ...]
       rosrun frontier_surfels mapper_node depth/image:=camera/depth/image_rect depth/camera_info:=camera/depth/camera_info _world_frame:=odom
       roslaunch frontier_surfels mapper.launch     does the same, with arguments that --ros-args lists

subscribes  depth/image, depth/camera_info, color/image (if use_color is true), tf
publishes   ~surfels, ~occupied, ~frontier, ~update, ~markers, ~report, /diagnostics
services    ~reset, ~pause, ~save_map, ~load_map, ~get_surfels

Parameters, in the node's private namespace:
)";

/// @return exit code
int end(frontier_surfels::MapperRos& mapper) {
  try {
    mapper.stop();
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "[FATAL] " << error.what() << std::endl;  // ROS_FATAL prints nothing after ros::spin()
    return 1;
  }
}

bool is_help(const std::string& argument) { return argument == "--help" || argument == "-h"; }

}  // namespace

int main(int argc, char** argv) {
  using namespace frontier_surfels;
  if (std::any_of(argv + 1, argv + argc, is_help)) {
    std::cout << kHelp << parameter_table() << node_parameter_table();
    return 0;
  }
  std::vector<std::string> arguments;
  ros::removeROSArgs(argc, argv, arguments);
  arguments.erase(arguments.begin());
  if (const std::string fault = fault_of_arguments(arguments); !fault.empty()) {
    std::cerr << fault << std::endl;
    return 2;
  }
  ros::init(argc, argv, "mapper");
  const ros::NodeHandle nh, pnh("~");  // must outlive the mapper: without a node handle the error below would not be logged
  try {
    MapperRos mapper(nh, pnh);
    ros::spin();
    return end(mapper);
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
}
