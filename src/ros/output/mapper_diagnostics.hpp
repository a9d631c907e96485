/// The mapper's part of `/diagnostics`.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>

#include <mutex>
#include <string>

#include "ros/input/warning_throttle.hpp"
#include "ros/output/mapping_status.hpp"

namespace frontier_surfels {

/// Publishes a MappingStatus once a second of wall time. All functions may be called from any thread.
class MapperDiagnostics {
 public:
  MapperDiagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& pnh, const std::string& device, const std::string& depth_topic);

  /// Counts a frame. If it was dropped, warns with the reason, at most every few seconds for each kind of reason.
  void add(const FrameReport& report);

  /// Sets the size of the map after a frame, a reset or a load; see MappingStatus.
  void set_map(const Statistics& map, std::size_t on_disk);
  void set_paused(bool paused);
  void set_map_folder_fault(const std::string& fault);  ///< empty: none

 private:
  using Clock = MappingStatus::Clock;

  void fill(diagnostic_updater::DiagnosticStatusWrapper& status);
  void warn(const FrameReport& report, Clock::time_point now);

  std::mutex mutex_;
  MappingStatus status_;
  WarningThrottle warnings_{std::chrono::seconds(5)};
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

}  // namespace frontier_surfels
