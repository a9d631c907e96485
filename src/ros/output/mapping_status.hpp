/// What `/diagnostics` says about mapping. No ROS communication, no clock and no locks in it.
#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <frontier_surfels/FrameReport.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Name of a result of FrameReport, for people: "dropped: no pose" for DROPPED_NO_POSE.
const char* result_name(std::uint8_t result);

/// Counts frames by their result. A failed frame is an ERROR with its reason for at least five seconds, and until frames are mapped again.
/// If there is a remark on every frame of the last five seconds, as when no depth can be used, it is a WARNING.
class MappingStatus {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kResults = FrameReport::FAILED + 1;

  MappingStatus(std::string device, std::string depth_topic) : device_(std::move(device)), depth_topic_(std::move(depth_topic)) {}

  void add(const FrameReport& report, Clock::time_point now);

  /// Sets the size of the map, which a frame, a reset or a load has changed. @param on_disk  number of further surfels in the map folder
  void set_map(const Statistics& map, std::size_t on_disk) {
    map_ = map;
    on_disk_ = on_disk;
  }
  void set_paused(bool paused) { paused_ = paused; }

  /// Sets why the map folder cannot be written, which is an ERROR; empty: it can.
  void set_map_folder_fault(const std::string& fault);

  void fill(diagnostic_updater::DiagnosticStatusWrapper& status, Clock::time_point now);

 private:
  struct MappedFrame {
    Clock::time_point time;
    double total_ms;
    std::string remark;  ///< why the frame adds nothing, or what is odd about it; empty for most
  };

  void summarize(diagnostic_updater::DiagnosticStatusWrapper& status, Clock::time_point now) const;

  const std::string device_, depth_topic_;
  std::array<std::uint64_t, kResults> counts_ = {};
  std::deque<MappedFrame> mapped_;  ///< frames of the last seconds
  Clock::time_point failed_;        ///< when the last frame failed
  bool mapped_since_ = false;       ///< a frame has been mapped after the one that failed, or what it failed for is over
  std::string failure_;             ///< reason of the last frame that failed
  std::string map_folder_fault_;
  std::string last_reason_;  ///< of the last frame that was dropped
  Statistics map_;           ///< in memory
  std::size_t on_disk_ = 0;
  bool paused_ = false;
};

}  // namespace frontier_surfels
