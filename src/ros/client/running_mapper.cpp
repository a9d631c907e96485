#include "ros/client/running_mapper.hpp"

#include <ros/master.h>
#include <ros/names.h>
#include <ros/param.h>
#include <ros/service.h>
#include <std_srvs/Trigger.h>

#include <sstream>
#include <utility>

#include "ros/input/conversions.hpp"

namespace frontier_surfels {
namespace {

using messages::strip_slash;
using XmlRpc::XmlRpcValue;

constexpr double kStartTimeout = 20;  // [s]
constexpr double kGone = 2;           // [s] without a connection, after which the mapper must have ended
constexpr double kMapTimeout = 60;    // [s]
const char* const kHowToStart = "start it with `roslaunch frontier_surfels mapper.launch`";

/// Checks that there is a master, because the constructor of a node handle would wait for it forever.
const std::string& with_master(const std::string& name) {
  if (!ros::master::check()) {
    throw Error("There is no ROS master at " + ros::master::getURI() + ", and therefore no mapper: " + kHowToStart +
                ", or set ROS_MASTER_URI to where it runs.");
  }
  return name;
}

/// The node that publishes a topic according to the master; empty if there is none.
std::string publisher_of(const std::string& topic) {
  XmlRpcValue request(ros::names::resolve("~")), response, state;
  if (!ros::master::execute("getSystemState", request, response, state, false)) return {};
  XmlRpcValue& publishers = state[0];
  for (int i = 0; i < publishers.size(); ++i) {
    XmlRpcValue& nodes = publishers[i][1];
    if (static_cast<std::string>(publishers[i][0]) == topic && nodes.size() > 0) return nodes[nodes.size() - 1];
  }
  return {};
}

}  // namespace

RunningMapper::RunningMapper(const std::string& name, std::function<bool()> stop)
    : nh_(with_master("")), stop_(std::move(stop)), name_(nh_.resolveName(name)) {
  nh_.setCallbackQueue(&queue_);
  report_topic_ = nh_.subscribe(name_ + "/report", 100, &RunningMapper::on_report, this);
  diagnostics_topic_ = nh_.subscribe("/diagnostics", 10, &RunningMapper::on_diagnostics, this);
  map_ = std::make_unique<MapSubscriber>(nh_, name_);

  require(
      [this] {
        return report_topic_.getNumPublishers() > 0 && map_->connected() && !(process_ = publisher_of(report_topic_.getTopic())).empty();
      },
      "There is no mapper " + name_ + ", because no node publishes " + name_ + "/report: " + kHowToStart +
          ", or name another with --mapper.");
  config_ = read_mapper_config(name_);
  world_frame_ = strip_slash(ros::param::param(name_ + "/world_frame", NodeConfig().world_frame));
}

std::string RunningMapper::device() const { return device_.empty() ? "that of the running mapper " + name_ : device_; }

void RunningMapper::reset() {
  std_srvs::Trigger service;
  if (!ros::service::call(name_ + "/reset", service))
    throw Error("The service " + name_ + "/reset did not answer: start the mapper again.");
  if (!service.response.success) throw Error("The mapper " + name_ + " could not be reset: " + service.response.message);
}

FrameReport RunningMapper::report_on(const ros::Time& stamp, double timeout) {
  FrameReportConstPtr found;
  auto connected = ros::WallTime::now();
  bool gone = false;
  wait_until(
      [&] {
        while (!found && !reports_.empty()) {
          if (reports_.front()->header.stamp == stamp) found = reports_.front();
          reports_.pop_front();
        }
        const auto now = ros::WallTime::now();
        if (report_topic_.getNumPublishers() > 0) connected = now;
        gone = (now - connected).toSec() > kGone;
        return found || gone;
      },
      timeout);
  if (found) return *found;
  if (gone) throw Error("The mapper " + name_ + " has ended during the replay: read its last messages, and start it again.");
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << "The mapper " << name_ << " has not reported on the depth image of stamp " << stamp << " within " << timeout
       << " s: check whether it still runs, read its last messages, and start it again.";
  throw Error(text.str());
}

std::vector<Surfel> RunningMapper::surfels(std::uint64_t sequence) {
  if (!wait_until([&] { return map_->map().sequence() >= sequence; }, kMapTimeout)) map_->take_all();
  return map_->map().surfels();
}

void RunningMapper::require(const std::function<bool()>& done, const std::string& otherwise) {
  const bool there = wait_until([&] { return stop_() || done(); }, kStartTimeout);
  if (stop_()) throw Error("Stopped before the first frame.");
  if (!there) throw Error(otherwise);
}

bool RunningMapper::wait_until(const std::function<bool()>& done, double timeout) {
  constexpr double kPoll = 0.02;  // [s] at most; a callback ends it at once
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout);
  while (!done()) {
    if (ros::WallTime::now() >= end) return false;
    queue_.callOne(ros::WallDuration(kPoll));
  }
  return true;
}

void RunningMapper::wait(double seconds) {
  wait_until([] { return false; }, seconds);
}

void RunningMapper::on_diagnostics(const diagnostic_msgs::DiagnosticArrayConstPtr& diagnostics) {
  for (const diagnostic_msgs::DiagnosticStatus& status : diagnostics->status) {
    if (strip_slash(status.name).rfind(strip_slash(name_) + ":", 0) == 0) device_ = status.hardware_id;
  }
}

}  // namespace frontier_surfels
