/// A mapper node that runs already, seen from another node.
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

/// Its configuration, its answers to frames, and its map. All callbacks are handled in the functions that wait, on their caller's thread.
class RunningMapper {
 public:
  /// Waits until the mapper is there. ros::init() must have been called.
  /// @param name  of the node, and so of its topics; resolved as all names are
  /// @param stop  asked while waiting: whether to give up
  /// @throws Error with what is missing
  RunningMapper(const std::string& name, std::function<bool()> stop);

  const std::string& name() const { return name_; }
  const std::string& process() const { return process_; }  ///< node whose connections are the mapper's: itself, or its nodelet manager
  const Config& config() const { return config_; }
  const std::string& world_frame() const { return world_frame_; }
  std::string device() const;  ///< for people

  /// For publishers whose subscribers are waited for.
  ros::NodeHandle& handle() { return nh_; }

  /// Empties the map. @throws Error
  void reset();

  /// The next report on the depth image of this stamp. @throws Error if there is none in time
  FrameReport report_on(const ros::Time& stamp, double timeout);

  /// All surfels of the map of number `sequence` or later, ordered by id. @throws Error
  std::vector<Surfel> surfels(std::uint64_t sequence);

  /// Waits for something the replay cannot begin without. @throws Error(otherwise) if it does not come, or on stop
  void require(const std::function<bool()>& done, const std::string& otherwise);

  /// Handles callbacks until done() or for so long [s, of wall time]. @return done()
  bool wait_until(const std::function<bool()>& done, double timeout);

  /// Handles callbacks for so long [s, of wall time].
  void wait(double seconds);

 private:
  void on_report(const FrameReportConstPtr& report) { reports_.push_back(report); }
  void on_diagnostics(const diagnostic_msgs::DiagnosticArrayConstPtr& diagnostics);

  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  std::function<bool()> stop_;
  std::string name_, process_, world_frame_, device_;
  Config config_;
  std::deque<FrameReportConstPtr> reports_;  ///< that nobody has asked for so far
  std::unique_ptr<MapSubscriber> map_;
  ros::Subscriber report_topic_, diagnostics_topic_;
};

}  // namespace frontier_surfels
