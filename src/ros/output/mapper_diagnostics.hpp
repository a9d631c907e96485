/// The mapper's part of `/diagnostics`.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <frontier_surfels/FrameReport.h>
#include <ros/node_handle.h>

#include <array>
#include <chrono>
#include <deque>
#include <mutex>
#include <string>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Name of a result of FrameReport, for people: "dropped: no pose" for DROPPED_NO_POSE.
const char* result_name(std::uint8_t result);

/// Counts frames by their result, and publishes once a second of wall time. All functions may be called from any thread.
class MapperDiagnostics {
 public:
  MapperDiagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& pnh, std::string device, std::string depth_topic);

  /// Counts a frame. If it was dropped, warns with the reason, at most every few seconds for each result.
  void add(const FrameReport& report);

  /// Sets the memory of the map and on the device [byte].
  void set_memory(std::size_t map_bytes, std::size_t seen_bytes, std::size_t device_bytes);
  void set_paused(bool paused);

 private:
  static constexpr std::size_t kResults = FrameReport::FAILED + 1;
  using Clock = std::chrono::steady_clock;

  void fill(diagnostic_updater::DiagnosticStatusWrapper& status);
  void warn(const FrameReport& report);

  std::mutex mutex_;
  const std::string device_, depth_topic_;
  std::array<std::uint64_t, kResults> counts_ = {};
  std::array<std::uint64_t, kResults> counts_told_ = {};
  std::array<Clock::time_point, kResults> warned_ = {};
  std::deque<std::pair<Clock::time_point, double>> mapped_;  ///< frames of the last seconds: time and total_ms
  std::size_t surfels_ = 0, map_bytes_ = 0, seen_bytes_ = 0, device_bytes_ = 0;
  bool paused_ = false;
  std::string last_reason_;
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

}  // namespace frontier_surfels
