/// Section "octomap": OctoMap and the mapper take turns frame by frame, so that other load on the machine affects both alike.
#include "apps/interrupt.hpp"
#include "bench/measured_run.hpp"
#include "bench/sections.hpp"
#include "bench/table.hpp"
#include "replay/summary.hpp"

namespace frontier_surfels::bench {
namespace {

using nlohmann::ordered_json;

constexpr double kResolution = 0.01;       // [m]
constexpr double kQuickResolution = 0.05;  // [m]

ordered_json octomap_statistics(const std::vector<replay::FrameRecord>& frames, double scoring::InsertionTime::*time) {
  std::vector<double> values;
  for (const replay::FrameRecord& frame : frames) values.push_back(frame.octomap.value().*time);
  return statistics_json(values);
}

ordered_json measure_row(const Options& options, const Input& input) {
  const Config config = input.config(kUsualWidth);
  const double resolution = options.quick ? kQuickResolution : kResolution;
  ordered_json row = {{"input", input.name()}, {"resolution", resolution}, {"z_max", config.z_max}};
  attempt(row, [&] {
    // OctoMap takes a second or more for a frame, so that only a few frames are used. Both maps get the same ones, so that both see the
    // same amount of new space in each.
    const auto source = input.open(options.octomap_frames);
    Mapper mapper(config);
    scoring::OctomapTruth octomap(resolution, config);
    const auto run = run_frames(mapper, input, *source, options,
                                [&](const DepthFrame& frame, replay::FrameRecord& record) { record.octomap = octomap.add(frame); });
    add_figures(run, row);
    const auto warm = replay::warm_frames(run.frames);
    row["octomap"] = {{"time_ms", octomap_statistics(warm, &scoring::InsertionTime::wall_ms)},
                      {"cpu_ms", octomap_statistics(warm, &scoring::InsertionTime::cpu_ms)},
                      {"memory_mb", octomap.memory_mb()}};
    const auto ratio = [&row](const char* time) { return double(row["octomap"][time]["median"]) / double(row[time]["median"]); };
    row["ratio_time"] = ratio("time_ms");
    row["ratio_cpu"] = ratio("cpu_ms");
  });
  return row;
}

}  // namespace

ordered_json measure_octomap(const Options& options, const std::vector<Input>& inputs) {
  ordered_json rows = ordered_json::array();
  const Table table("OctoMap's insertPointCloud on the same frames, median ms a frame",
                    {"input", "voxel cm", "frames", "its CPU", "our CPU", "CPU ratio", "its wall", "our wall", "wall ratio"});
  for (const Input& input : inputs) {
    if (replay::stop_requested()) break;
    const ordered_json row = measure_row(options, input);
    std::vector<std::string> cells = {row["input"], fixed(100 * double(row["resolution"]), 0)};
    if (row.contains("error")) {
      cells.push_back(row["error"]);
    } else {
      cells.push_back(std::to_string(int(row["frames"])));
      for (const char* time : {"cpu_ms", "time_ms"}) {
        cells.push_back(fixed(row["octomap"][time]["median"], 1));
        cells.push_back(fixed(row[time]["median"], 1));
        cells.push_back(fixed(row[time == std::string("cpu_ms") ? "ratio_cpu" : "ratio_time"], 1));
      }
    }
    table.row(cells);
    rows.push_back(row);
  }
  return rows;
}

}  // namespace frontier_surfels::bench
