/// mapper_node: the mapper as a node of its own.
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>

#include <iostream>

#include "ros/mapper_ros.hpp"

int main(int argc, char** argv) {
  ros::init(argc, argv, "mapper");
  const ros::NodeHandle nh, pnh("~");  // outlive the mapper: with the last handle the log ends, and what is wrong would not be said
  try {
    const frontier_surfels::MapperRos mapper(nh, pnh);
    ros::spin();
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
}
