/// simulated_camera: a depth camera in the synthetic flat, as a node.
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>

#include <string>

#include "ros/arguments.hpp"
#include "ros/simulation/simulation_ros.hpp"

namespace {

constexpr char kHelp[] =
    R"(A depth camera in a synthetic flat of five rooms and a corridor. It goes where it is told, but not through solids.

usage: rosrun frontier_surfels simulated_camera [TOPIC:=OTHER_TOPIC ...] [_PARAMETER:=VALUE ...]

subscribes  ~goal: pose of the body (x forward, z up) in the world frame
publishes   depth/image, depth/camera_info, tf; ~coverage: how much has been seen of what can be seen at all
services    ~move: to a pose, with an answer; ~capture: one more image from where the camera is; ~reset: back to the start

Parameters, in the node's private namespace:
)";

}  // namespace

int main(int argc, char** argv) {
  using namespace frontier_surfels;
  if (const auto code = answer_arguments(argc, argv, "simulated_camera", [] { return kHelp + simulation_parameter_table(); })) return *code;
  ros::init(argc, argv, "simulated_camera");
  const ros::NodeHandle nh, pnh("~");  // must outlive the camera: without a node handle the error below would not be logged
  try {
    SimulationRos simulation(nh, pnh);
    ros::spin();
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
}
