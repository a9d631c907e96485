#include "ros/output/mapping_status.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

#include "frontier_surfels/number_text.hpp"

namespace frontier_surfels {
namespace {

constexpr auto kWindow = std::chrono::seconds(5);  // over which the rate is measured, and for which a failure is an error at least

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

void MappingStatus::add(const FrameReport& report, Clock::time_point now) {
  ++counts_[report.result];
  if (report.result == FrameReport::INTEGRATED) {
    mapped_.push_back({now, report.total_ms, report.reason});
    mapped_since_ = true;
    while (now - mapped_.front().time > kWindow) mapped_.pop_front();
  } else if (report.result == FrameReport::FAILED) {
    failed_ = now;
    failure_ = report.reason;
    mapped_since_ = false;
  } else if (report.result != FrameReport::DROPPED_PAUSED) {
    last_reason_ = report.reason;
  }
}

void MappingStatus::set_map_folder_fault(const std::string& fault) {
  const bool over = fault.empty() && !map_folder_fault_.empty();
  if (over && failure_ == map_folder_fault_) mapped_since_ = true;  // or it would stay an error until the next frame
  map_folder_fault_ = fault;
}

void MappingStatus::fill(diagnostic_updater::DiagnosticStatusWrapper& status, Clock::time_point now) {
  while (!mapped_.empty() && now - mapped_.front().time > kWindow) mapped_.pop_front();
  summarize(status, now);
  std::vector<double> times;
  for (const MappedFrame& frame : mapped_) times.push_back(frame.total_ms);
  status.add("rate [Hz]", fixed_text(static_cast<double>(times.size()) / std::chrono::duration<double>(kWindow).count(), 1));
  status.add("time a frame, median [ms]", fixed_text(median(times), 1));
  status.add("time a frame, longest [ms]", fixed_text(times.empty() ? 0.0 : *std::max_element(times.begin(), times.end()), 1));
  for (std::uint8_t result = 0; result < kResults; ++result)
    status.add(std::string("frames ") + result_name(result), std::to_string(counts_[result]));
  if (counts_[FrameReport::FAILED] > 0) status.add("last failure", failure_);
  status.add("surfels", std::to_string(map_.surfels + on_disk_));
  status.add("surfels on disk only", std::to_string(on_disk_));
  status.add("memory of the map [MB]", fixed_text(static_cast<double>(map_.map_bytes) / 1e6, 1));
  status.add("memory of what has been seen [MB]", fixed_text(static_cast<double>(map_.seen_bytes) / 1e6, 1));
  status.add("memory on the device [MB]", fixed_text(static_cast<double>(map_.device_bytes) / 1e6, 1));
  status.add("device", device_);
}

void MappingStatus::summarize(diagnostic_updater::DiagnosticStatusWrapper& status, Clock::time_point now) const {
  using diagnostic_msgs::DiagnosticStatus;
  const std::uint64_t all = std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
  if (counts_[FrameReport::FAILED] > 0 && (!mapped_since_ || now - failed_ <= kWindow)) {
    status.summary(DiagnosticStatus::ERROR, failure_);
  } else if (!map_folder_fault_.empty()) {
    status.summary(DiagnosticStatus::ERROR, map_folder_fault_);
  } else if (paused_) {
    status.summary(DiagnosticStatus::OK, "paused");
  } else if (all == 0) {
    status.summary(DiagnosticStatus::WARN, "no depth image has come on " + depth_topic_);
  } else if (mapped_.empty()) {
    status.summary(DiagnosticStatus::WARN, last_reason_.empty() ? "no depth image has come lately" : last_reason_);
  } else if (std::none_of(mapped_.begin(), mapped_.end(), [](const MappedFrame& frame) { return frame.remark.empty(); })) {
    status.summary(DiagnosticStatus::WARN, mapped_.back().remark);
  } else {
    status.summary(DiagnosticStatus::OK, "mapping");
  }
}

}  // namespace frontier_surfels
