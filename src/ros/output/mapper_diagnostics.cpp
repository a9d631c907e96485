#include "ros/output/mapper_diagnostics.hpp"

#include <ros/console.h>

#include <algorithm>
#include <numeric>
#include <vector>

namespace frontier_surfels {
namespace {

constexpr auto kWindow = std::chrono::seconds(5);   // over which the rate is measured
constexpr auto kBetween = std::chrono::seconds(5);  // shortest time between two warnings with the same result

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

const char* result_name(std::uint8_t result) {
  switch (result) {
    case FrameReport::INTEGRATED:
      return "integrated";
    case FrameReport::DROPPED_QUEUE:
      return "dropped: the mapper was busy";
    case FrameReport::DROPPED_PAUSED:
      return "dropped: paused";
    case FrameReport::DROPPED_NO_POSE:
      return "dropped: no pose";
    case FrameReport::DROPPED_NO_CAMERA:
      return "dropped: no camera_info";
    case FrameReport::DROPPED_BAD_IMAGE:
      return "dropped: bad image";
    case FrameReport::DROPPED_OUT_OF_ORDER:
      return "dropped: out of order";
    default:
      return "failed";
  }
}

MapperDiagnostics::MapperDiagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& pnh, std::string device, std::string depth_topic)
    : device_(std::move(device)), depth_topic_(std::move(depth_topic)), updater_(nh, pnh, pnh.getNamespace()) {
  updater_.setHardwareID(device_);
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
  ++counts_[report.result];
  surfels_ = report.surfels;
  if (report.result == FrameReport::INTEGRATED) {
    const auto now = Clock::now();
    mapped_.emplace_back(now, report.total_ms);
    while (now - mapped_.front().first > kWindow) mapped_.pop_front();
  } else if (report.result != FrameReport::DROPPED_PAUSED) {
    last_reason_ = report.reason;
    // That the camera is faster than the mapper needs no warning.
    if (report.result != FrameReport::DROPPED_QUEUE) warn(report);
  }
}

void MapperDiagnostics::warn(const FrameReport& report) {
  const auto now = Clock::now();
  auto& last = warned_[report.result];
  if (last != Clock::time_point() && now - last < kBetween) return;
  last = now;
  const std::uint64_t since = counts_[report.result] - counts_told_[report.result];
  counts_told_[report.result] = counts_[report.result];
  ROS_WARN("%s (%lu depth image%s dropped)", report.reason.c_str(), static_cast<unsigned long>(since), since == 1 ? "" : "s");
}

void MapperDiagnostics::set_memory(std::size_t map_bytes, std::size_t device_bytes) {
  const std::lock_guard<std::mutex> lock(mutex_);
  map_bytes_ = map_bytes;
  device_bytes_ = device_bytes;
}

void MapperDiagnostics::set_paused(bool paused) {
  const std::lock_guard<std::mutex> lock(mutex_);
  paused_ = paused;
}

void MapperDiagnostics::fill(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto now = Clock::now();
  while (!mapped_.empty() && now - mapped_.front().first > kWindow) mapped_.pop_front();
  std::vector<double> times;
  for (const auto& frame : mapped_) times.push_back(frame.second);

  const std::uint64_t all = std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
  if (counts_[FrameReport::FAILED] > 0) {
    status.summary(DiagnosticStatus::ERROR, last_reason_);
  } else if (paused_) {
    status.summary(DiagnosticStatus::OK, "paused");
  } else if (all == 0) {
    status.summary(DiagnosticStatus::WARN, "no depth image has come on " + depth_topic_);
  } else if (times.empty()) {
    status.summary(DiagnosticStatus::WARN, last_reason_.empty() ? "no depth image has come lately" : last_reason_);
  } else {
    status.summary(DiagnosticStatus::OK, "mapping");
  }
  status.addf("rate [Hz]", "%.1f", static_cast<double>(times.size()) / std::chrono::duration<double>(kWindow).count());
  status.addf("time a frame, median [ms]", "%.1f", median(times));
  status.addf("time a frame, longest [ms]", "%.1f", times.empty() ? 0.0 : *std::max_element(times.begin(), times.end()));
  for (std::uint8_t result = 0; result < kResults; ++result) status.add(std::string("frames ") + result_name(result), counts_[result]);
  status.add("surfels", surfels_);
  status.addf("memory of the map [MB]", "%.1f", map_bytes_ / 1e6);
  status.addf("memory on the device [MB]", "%.1f", device_bytes_ / 1e6);
  status.add("device", device_);
}

}  // namespace frontier_surfels
