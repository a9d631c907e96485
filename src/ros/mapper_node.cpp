/// mapper_node: the mapper as a node.
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>

#include <iostream>

#include "ros/mapper_ros.hpp"

int main(int argc, char** argv) {
  ros::init(argc, argv, "mapper");
  const ros::NodeHandle nh, pnh("~");  // must outlive the mapper: without a node handle the error below would not be logged
  try {
    const frontier_surfels::MapperRos mapper(nh, pnh);
    ros::spin();
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
}
