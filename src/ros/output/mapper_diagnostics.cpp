#include "ros/output/mapper_diagnostics.hpp"

#include <ros/console.h>

namespace frontier_surfels {

MapperDiagnostics::MapperDiagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& pnh, const std::string& device,
                                     const std::string& depth_topic)
    : status_(device, depth_topic), updater_(nh, pnh, pnh.getNamespace()) {
  updater_.setHardwareID(device);
  updater_.add("mapping", this, &MapperDiagnostics::fill);
  // Wall time, because ROS time stands still while a bag is paused.
  timer_ = ros::NodeHandle(nh).createWallTimer(ros::WallDuration(1), [this](const ros::WallTimerEvent&) {
    try {
      updater_.force_update();
    } catch (const std::exception& fault) {  // it adds its period to ROS time, which overflows if /clock is at its end
      ROS_WARN_ONCE("/diagnostics cannot be published: %s. Check what publishes /clock.", fault.what());
    }
  });
}

void MapperDiagnostics::add(const FrameReport& report) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto now = Clock::now();
  status_.add(report, now);
  // That the camera is faster than the mapper needs no warning.
  if (report.result != FrameReport::INTEGRATED && report.result != FrameReport::DROPPED_PAUSED &&
      report.result != FrameReport::DROPPED_QUEUE)
    warn(report, now);
}

void MapperDiagnostics::warn(const FrameReport& report, Clock::time_point now) {
  const std::size_t count = warnings_.due(report.reason, now);
  if (count == 0) return;
  ROS_WARN("%s (%zu depth image%s dropped)", report.reason.c_str(), count, count == 1 ? "" : "s");
}

void MapperDiagnostics::set_map(const Statistics& map, std::size_t on_disk) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.set_map(map, on_disk);
}

void MapperDiagnostics::set_paused(bool paused) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.set_paused(paused);
}

void MapperDiagnostics::set_map_folder_fault(const std::string& fault) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.set_map_folder_fault(fault);
}

void MapperDiagnostics::fill(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.fill(status, Clock::now());
}

}  // namespace frontier_surfels
