/// Sections "start" and "memory": each measurement runs in a process of its own.
#include <stdlib.h>

#include <chrono>
#include <filesystem>

#include "apps/interrupt.hpp"
#include "bench/child_process.hpp"
#include "bench/measured_run.hpp"
#include "bench/sections.hpp"
#include "bench/table.hpp"

namespace frontier_surfels::bench {
namespace {

using nlohmann::ordered_json;

constexpr int kWarmStarts = 5;

double since_ms(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

/// An empty folder that is removed at the end with everything in it.
class TemporaryFolder {
 public:
  TemporaryFolder() : path_((std::filesystem::temp_directory_path() / "bench_kernels_XXXXXX").string()) {
    if (mkdtemp(path_.data()) == nullptr) throw FileError("No temporary folder '" + path_ + "' could be made: set TMPDIR to another.");
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

ordered_json start_row(const Options& options, const Input& input) {
  ordered_json row = {{"input", input.name()}};
  attempt(row, [&] {
    const TemporaryFolder kernels;
    row["cold"] = run_child("start", options, input, kernels.path());
    std::vector<double> total_ms;
    ordered_json warm = ordered_json::array();
    for (int n = 0; n < (options.quick ? 1 : kWarmStarts) && !replay::stop_requested(); ++n) {
      warm.push_back(run_child("start", options, input, kernels.path()));
      total_ms.push_back(warm.back()["total_ms"]);
    }
    if (total_ms.empty()) throw Error("Interrupted.");
    row["warm"] = warm;
    row["warm_ms"] = statistics_json(total_ms)["median"];
    row["cold_ms"] = row["cold"]["total_ms"];
  });
  return row;
}

}  // namespace

ordered_json child_start(const Input& input) {
  const auto frame = input.open()->next();
  if (!frame) throw Error("The first frame of '" + input.name() + "' could not be read again.");
  const auto start = std::chrono::steady_clock::now();
  Mapper mapper(input.config(kUsualWidth));
  const double construct_ms = since_ms(start);
  const Report report = mapper.integrate(frame->view());
  return {{"construct_ms", construct_ms}, {"first_frame_ms", report.total_ms}, {"total_ms", since_ms(start)}};
}

ordered_json measure_start(const Options& options, const std::vector<Input>& inputs) {
  ordered_json rows = ordered_json::array();
  const Table table("Start-up in a new process: constructor and first frame, ms",
                    {"input", "no kernel cache", "with cache", "of it constructor", "first frame"});
  for (const Input& input : inputs) {
    if (replay::stop_requested()) break;
    const ordered_json row = start_row(options, input);
    if (row.contains("error")) {
      table.row({row["input"], row["error"]});
    } else {
      const auto& last = row["warm"].back();
      table.row({row["input"], fixed(row["cold_ms"], 0), fixed(row["warm_ms"], 0), fixed(last["construct_ms"], 0),
                 fixed(last["first_frame_ms"], 0)});
    }
    rows.push_back(row);
  }
  return rows;
}

ordered_json child_memory(const Options& options, const Input& input) {
  ordered_json row = {{"input", input.name()}};
  attempt(row, [&] {
    const auto source = input.open();
    row["rss_before_mb"] = replay::peak_rss_mb();
    Mapper mapper(input.config(kUsualWidth));
    row["rss_constructed_mb"] = replay::peak_rss_mb();
    add_figures(run_frames(mapper, input, *source, options), row);
    row["rss_peak_mb"] = replay::peak_rss_mb();
  });
  return row;
}

ordered_json measure_memory(const Options& options, const std::vector<Input>& inputs) {
  ordered_json rows = ordered_json::array();
  const Table table("Memory in a new process, MB; RSS: largest so far, with the device's driver",
                    {"input", "frames", "surfels", "map and seen", "bytes a surfel", "working", "RSS before", "mapper made", "at the end"});
  for (const Input& input : inputs) {
    if (replay::stop_requested()) break;
    ordered_json row = {{"input", input.name()}};
    attempt(row, [&] {
      run_child("start", options, input);  // compiles the kernels, whose memory must not be counted
      row = run_child("memory", options, input);
    });
    if (row.contains("error")) {
      table.row({row["input"], row["error"]});
    } else {
      table.row({row["input"], std::to_string(int(row["frames"])), std::to_string(std::size_t(row["surfels"])),
                 fixed((double(row["map_bytes"]) + double(row["seen_bytes"])) / 1e6, 1), fixed(row["bytes_a_surfel"], 1),
                 fixed(double(row["working_bytes"]) / 1e6, 1), fixed(row["rss_before_mb"], 0), fixed(row["rss_constructed_mb"], 0),
                 fixed(row["rss_peak_mb"], 0)});
    }
    rows.push_back(row);
  }
  return rows;
}

}  // namespace frontier_surfels::bench
