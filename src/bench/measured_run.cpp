#include "bench/measured_run.hpp"

#include <algorithm>
#include <chrono>

#include "apps/interrupt.hpp"
#include "replay/summary.hpp"
#include "replay/warnings.hpp"

namespace frontier_surfels::bench {

using nlohmann::ordered_json;

replay::Run run_frames(Mapper& mapper, const Input& input, replay::FrameSource& source, const Options& options,
                       const AfterFrame& after_frame) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(options.row_seconds);
  const auto stop = [&] { return replay::stop_requested() || Clock::now() > end; };
  const auto nothing = [](const DepthFrame&, replay::FrameRecord&) {};
  replay::Run run = replay::map_frames(mapper, source, after_frame ? after_frame : nothing, stop);
  if (!run.unsaved.empty()) throw FileError(run.unsaved);
  if (run.frames.empty()) throw Error("No frame could be used" + (run.skipped.empty() ? "." : ": " + run.skipped.front()));
  if (run.frames.back().report.surfels == 0) throw EmptyMap(replay::empty_map(input.path(), replay::warnings(run)).what());
  return run;
}

ordered_json statistics_json(const std::vector<double>& values) {
  const replay::TimeStatistics statistics = replay::time_statistics(values);
  return {{"mean", statistics.mean},
          {"median", statistics.median},
          {"p95", statistics.p95},
          {"max", statistics.max},
          {"rsd_percent", statistics.rsd_percent}};
}

std::size_t working_memory(const Report& report) {
  const std::size_t kept = report.map_bytes + report.seen_bytes;  // a little of which is the host's
  return report.device_bytes > kept ? report.device_bytes - kept : 0;
}

void add_figures(const replay::Run& run, ordered_json& row) {
  const auto warm = replay::warm_frames(run.frames);
  std::vector<double> cpu_ms;
  for (const auto& frame : warm) cpu_ms.push_back(frame.cpu_ms);
  std::size_t working_bytes = 0;
  for (const auto& frame : run.frames) working_bytes = std::max(working_bytes, working_memory(frame.report));
  const Report& last = run.frames.back().report;
  row["device"] = run.device;
  row["frames"] = run.frames.size();
  row["complete"] = !run.stopped;
  row["time_ms"] = replay::time_json(warm, replay::stage_names(run.frames));
  row["cpu_ms"] = statistics_json(cpu_ms);
  row["surfels"] = last.surfels;
  row["map_bytes"] = last.map_bytes;
  row["seen_bytes"] = last.seen_bytes;
  row["bytes_a_surfel"] = static_cast<double>(last.map_bytes + last.seen_bytes) / static_cast<double>(last.surfels);
  row["working_bytes"] = working_bytes;
  if (const auto warnings = replay::warnings(run); !warnings.empty()) row["warnings"] = warnings;
}

void attempt(ordered_json& row, const std::function<void()>& measure) {
  try {
    measure();
  } catch (const EmptyMap& empty) {
    row["error"] = empty.what();
    row["empty_map"] = true;
  } catch (const std::bad_alloc&) {
    row["error"] = "Out of memory.";
  } catch (const std::exception& error) {
    row["error"] = error.what();
  }
}

}  // namespace frontier_surfels::bench
