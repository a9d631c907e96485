/// mapper_node: the mapper as a node.
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>

#include <iostream>
#include <string>

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
            for planners: ~states_update, ~clusters, ~cluster_markers, ~projected_map, ~octomap_full (if built with octomap_msgs)
services    ~reset, ~pause, ~save_map, ~load_map, ~get_surfels
            for planners: ~get_states, ~cast_rays, ~evaluate_views, ~get_state_grid, ~save_octomap

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

}  // namespace

int main(int argc, char** argv) {
  using namespace frontier_surfels;
  if (const auto code = answer_arguments(argc, argv, "mapper_node", [] { return kHelp + parameter_table() + node_parameter_table(); }))
    return *code;
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
