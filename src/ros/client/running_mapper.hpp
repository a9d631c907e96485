/// A running mapper node, as another node sees it.
#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <frontier_surfels/FrameReport.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <deque>
#include <functional>
#include <memory>
#include <string>

#include "ros/client/map_subscriber.hpp"
#include "ros/input/parameters.hpp"

namespace frontier_surfels {

/// The mapper's configuration, its reports on frames, and its map. Callbacks are handled only in functions that wait, on the caller's
/// thread.
class RunningMapper {
 public:
  /// Waits until the mapper is found. ros::init() must have been called.
  /// @param name  name of the node; it is resolved like all names in ROS
  /// @param stop  asked while waiting; if it returns true, waiting ends
  /// @throws Error that says what is missing
  RunningMapper(const std::string& name, std::function<bool()> stop);

  const std::string& name() const { return name_; }
  const std::string& process() const { return process_; }  ///< node that the mapper runs in: the mapper itself, or its nodelet manager
  const Config& config() const { return config_; }
  const std::string& world_frame() const { return world_frame_; }
  std::string device() const;  ///< name of its OpenCL device, for people

  /// The node handle whose callbacks are handled while waiting, for publishers that wait for subscribers.
  ros::NodeHandle& handle() { return nh_; }

  /// Empties the map. @throws Error if the mapper does not answer or fails
  void reset();

  /// Waits for the next report on the depth image with this stamp, at most `timeout` seconds. @throws Error if there is none
  FrameReport report_on(const ros::Time& stamp, double timeout);

  /// Waits for the map with the number `sequence` or a later one. @return all surfels, ordered by id @throws Error if it does not come
  std::vector<Surfel> surfels(std::uint64_t sequence);

  /// Waits until done() returns true. @throws Error(otherwise) if it takes too long, and Error if stop() ends the wait
  void require(const std::function<bool()>& done, const std::string& otherwise);

  /// Handles callbacks until done() returns true, at most `timeout` seconds of wall time. @return done()
  bool wait_until(const std::function<bool()>& done, double timeout);

  /// Handles callbacks for this number of seconds of wall time.
  void wait(double seconds);

 private:
  void on_report(const FrameReportConstPtr& report) { reports_.push_back(report); }
  void on_diagnostics(const diagnostic_msgs::DiagnosticArrayConstPtr& diagnostics);

  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  std::function<bool()> stop_;
  std::string name_, process_, world_frame_, device_;
  Config config_;
  std::deque<FrameReportConstPtr> reports_;  ///< reports that have not been asked for
  std::unique_ptr<MapSubscriber> map_;
  ros::Subscriber report_topic_, diagnostics_topic_;
};

}  // namespace frontier_surfels
