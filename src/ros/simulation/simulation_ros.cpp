#include "ros/simulation/simulation_ros.hpp"

#include <cv_bridge/cv_bridge.h>
#include <ros/console.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_msgs/TFMessage.h>

#include "frontier_surfels/Coverage.h"
#include "ros/input/conversions.hpp"

namespace frontier_surfels {
namespace {

constexpr double kPosePeriod = 0.1;  // [s]; an image's own transform is sent with it

SimulationConfig read(const ros::NodeHandle& pnh) {
  std::vector<std::string> warnings;
  const SimulationConfig config = read_simulation_parameters(pnh, warnings);
  for (const std::string& warning : warnings) ROS_WARN("%s", warning.c_str());
  return config;
}

tf2_msgs::TFMessage to_tf(const Eigen::Isometry3d& T_parent_child, const std::string& parent, const std::string& child,
                          const ros::Time& stamp) {
  const geometry_msgs::Pose pose = messages::to_pose(T_parent_child);
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = stamp;
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform.translation.x = pose.position.x;
  transform.transform.translation.y = pose.position.y;
  transform.transform.translation.z = pose.position.z;
  transform.transform.rotation = pose.orientation;
  tf2_msgs::TFMessage message;
  message.transforms = {transform};
  return message;
}

}  // namespace

SimulationRos::SimulationRos(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh),
      pnh_(pnh),
      config_(read(pnh)),
      flat_(replay::synthetic_flat()),
      camera_(flat_, config_.start(), config_.camera()),
      // What can be seen at all is the same for all starts, so that shares can be compared.
      coverage_(flat_, replay::flat_bounds(), replay::flat_start().translation(), config_.coverage()) {
  for_each_simulation_field(config_, [this](const FieldInfo& info, const auto& value) { pnh_.setParam(info.name, value); });
  advertise();
  ROS_INFO("The simulated camera is ready: %zu points of the flat can be seen.", coverage_.points().size());
}

void SimulationRos::advertise() {
  image_ = nh_.advertise<sensor_msgs::Image>("depth/image", 10);
  info_ = nh_.advertise<sensor_msgs::CameraInfo>("depth/camera_info", 10);
  tf_ = nh_.advertise<tf2_msgs::TFMessage>("/tf", 100);
  tf_static_ = nh_.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
  coverage_share_ = pnh_.advertise<frontier_surfels::Coverage>("coverage", 10, true);
  tf_static_.publish(to_tf(replay::T_body_optical(), config_.body_frame, config_.camera_frame, ros::Time::now()));
  publish_coverage(ros::Time::now());
  goal_ = pnh_.subscribe<geometry_msgs::PoseStamped>("goal", 10, [this](const geometry_msgs::PoseStampedConstPtr& goal) { follow(*goal); });
  move_ = pnh_.advertiseService("move", &SimulationRos::move, this);
  capture_ = pnh_.advertiseService("capture", &SimulationRos::capture, this);
  reset_ = pnh_.advertiseService("reset", &SimulationRos::reset, this);
  pose_timer_ = nh_.createTimer(ros::Duration(kPosePeriod), [this](const ros::TimerEvent&) { publish_pose(next_stamp()); });
  if (config_.publish_rate > 0)
    image_timer_ = nh_.createTimer(ros::Duration(1 / config_.publish_rate), [this](const ros::TimerEvent&) { publish_image(); });
}

replay::Move SimulationRos::move_to(const geometry_msgs::PoseStamped& goal, const std::vector<geometry_msgs::Point>& via) {
  const std::string frame = messages::strip_slash(goal.header.frame_id);
  if (!frame.empty() && frame != config_.world_frame)
    throw Error("The goal is given in the frame '" + frame + "': it must be in '" + config_.world_frame + "'.");
  std::vector<Eigen::Isometry3d> poses;
  try {
    const Eigen::Isometry3d T_world_goal = messages::to_isometry(goal.pose);
    for (const geometry_msgs::Point& corner : via) {
      poses.push_back(T_world_goal);
      poses.back().translation() << corner.x, corner.y, corner.z;
      if (!poses.back().translation().allFinite()) throw Error("A corner of the way is not finite.");
    }
    poses.push_back(T_world_goal);
  } catch (const BadFrame&) {
    throw Error("The goal is no pose: its numbers must be finite, and its quaternion not 0.");
  }
  replay::Move all;
  for (const Eigen::Isometry3d& pose : poses) {
    const replay::Move move = camera_.move_to(pose);
    all = {move.reached, all.metres + move.metres, move.message};
    if (!move.reached) break;
  }
  return all;
}

bool SimulationRos::move(MoveCamera::Request& request, MoveCamera::Response& response) {
  try {
    const replay::Move move = move_to(request.goal, request.via);
    response.success = move.reached;
    response.message = move.message;
    response.metres = move.metres;
    response.stamp = publish_image();
  } catch (const std::exception& error) {
    response.success = false;
    response.message = error.what();
  }
  response.pose = messages::to_pose(camera_.T_world_body());
  return true;
}

/// As at the start, for another exploration. The stamps go on, because a mapper takes no earlier ones.
bool SimulationRos::reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  camera_.restart();
  coverage_.reset();
  first_stamp_.reset();
  publish_coverage(next_stamp());
  response.success = true;
  response.message = "The camera is at its start, and has seen nothing.";
  return true;
}

bool SimulationRos::capture(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const ros::Time stamp = publish_image();
  response.success = true;
  response.message = "An image was taken at " + std::to_string(stamp.toSec()) + " s.";
  return true;
}

void SimulationRos::follow(const geometry_msgs::PoseStamped& goal) {
  try {
    const replay::Move move = move_to(goal);
    if (!move.reached) ROS_WARN("%s", move.message.c_str());
    publish_image();
  } catch (const std::exception& error) {
    ROS_WARN("A message of ~goal is not used: %s", error.what());
  }
}

/// Images of the same stamp, or of an earlier one, would be refused by the mapper.
ros::Time SimulationRos::next_stamp() {
  const ros::Time now = ros::Time::now(), least = last_stamp_ + ros::Duration(0, 1);
  const bool jumped_back = now + ros::Duration(1) < last_stamp_;
  last_stamp_ = now < least && !jumped_back ? least : now;
  return last_stamp_;
}

ros::Time SimulationRos::publish_image() {
  const replay::SensedFrame& frame = camera_.image();
  const ros::Time stamp = next_stamp();
  publish_pose(stamp);

  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = config_.camera_frame;
  sensor_msgs::CameraInfo info = messages::to_camera_info(frame.measured.intrinsics);
  info.header = header;
  info_.publish(info);
  const cv::Mat& depth = frame.measured.depth;
  const bool in_metres = depth.type() == CV_32FC1;
  namespace encodings = sensor_msgs::image_encodings;
  image_.publish(cv_bridge::CvImage(header, in_metres ? encodings::TYPE_32FC1 : encodings::TYPE_16UC1, depth).toImageMsg());

  if (!first_stamp_) first_stamp_ = stamp;
  coverage_.add(frame.measured.view());
  publish_coverage(stamp);
  return stamp;
}

void SimulationRos::publish_pose(const ros::Time& stamp) {
  tf_.publish(to_tf(camera_.T_world_body(), config_.world_frame, config_.body_frame, stamp));
}

void SimulationRos::publish_coverage(const ros::Time& stamp) {
  frontier_surfels::Coverage message;
  message.header.stamp = stamp;
  message.header.frame_id = config_.world_frame;
  message.views = static_cast<std::uint32_t>(camera_.images());
  message.metres = camera_.metres();
  message.seconds = first_stamp_ ? messages::seconds(*first_stamp_, stamp) : 0;
  message.seen = static_cast<std::uint32_t>(coverage_.seen_points());
  message.visible = static_cast<std::uint32_t>(coverage_.points().size());
  message.share = coverage_.share();
  coverage_share_.publish(message);
}

}  // namespace frontier_surfels
