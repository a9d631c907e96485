/// The simulated camera among ROS nodes.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <ros/subscriber.h>
#include <ros/timer.h>
#include <std_srvs/Trigger.h>

#include <optional>
#include <string>
#include <vector>

#include "frontier_surfels/MoveCamera.h"
#include "ros/simulation/simulation_parameters.hpp"
#include "synthetic/coverage.hpp"
#include "synthetic/simulated_camera.hpp"
#include "synthetic/synthetic_flat.hpp"

namespace frontier_surfels {

/// Publishes depth/image, depth/camera_info, tf and ~coverage; listens to ~goal; answers ~move, ~capture and ~reset. All callbacks must be
/// called by one thread.
class SimulationRos {
 public:
  /// @throws Error if a parameter cannot be used. Takes seconds, because it finds out what can be seen of the flat
  SimulationRos(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);

 private:
  void advertise();
  bool move(MoveCamera::Request& request, MoveCamera::Response& response);
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool capture(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  void follow(const geometry_msgs::PoseStamped& goal);
  /// @throws Error if the goal makes no sense, or a corner; the camera then stays where it is
  replay::Move move_to(const geometry_msgs::PoseStamped& goal, const std::vector<geometry_msgs::Point>& via = {});
  ros::Time publish_image();  ///< @return its stamp
  void publish_pose(const ros::Time& stamp);
  void publish_coverage(const ros::Time& stamp);
  ros::Time next_stamp();

  ros::NodeHandle nh_, pnh_;
  SimulationConfig config_;
  replay::World flat_;
  replay::SimulatedCamera camera_;
  replay::Coverage coverage_;
  std::optional<ros::Time> first_stamp_;
  ros::Time last_stamp_;
  ros::Publisher image_, info_, tf_, tf_static_, coverage_share_;
  ros::Subscriber goal_;
  ros::ServiceServer move_, capture_, reset_;
  ros::Timer image_timer_, pose_timer_;
};

}  // namespace frontier_surfels
