/// Section "frames": whole frames, for several sizes of the working image, depth ranges and numbers of threads.
#include <algorithm>

#include "apps/interrupt.hpp"
#include "bench/measured_run.hpp"
#include "bench/sections.hpp"
#include "bench/table.hpp"

namespace frontier_surfels::bench {
namespace {

using nlohmann::ordered_json;

std::string size_text(const ordered_json& row) { return std::to_string(int(row["width"])) + "x" + std::to_string(int(row["height"])); }

std::string threads_text(const ordered_json& row) { return row["threads"] == 0 ? "all" : std::to_string(int(row["threads"])); }

/// One configuration for each image size: 160, 320 and 640 pixels wide, where the images are large enough.
std::vector<Config> sizes(const Input& input, bool quick) {
  std::vector<Config> configs;
  for (const int width : quick ? std::vector<int>{kUsualWidth} : std::vector<int>{kUsualWidth, 2 * kUsualWidth, 4 * kUsualWidth}) {
    const Config config = input.config(width);
    const bool repeated = !configs.empty() && configs.back().decimation == config.decimation;
    if (!repeated) configs.push_back(config);
  }
  return configs;
}

ordered_json measure_row(const Options& options, const Input& input, const Config& config) {
  ordered_json row = {{"input", input.name()},
                      {"width", input.width(config)},
                      {"height", input.height(config)},
                      {"z_max", config.z_max},
                      {"threads", config.threads}};
  attempt(row, [&] {
    const auto source = input.open();
    Mapper mapper(config);
    add_figures(run_frames(mapper, input, *source, options), row);
  });
  return row;
}

void print_row(const Table& table, const ordered_json& row) {
  std::vector<std::string> cells = {row["input"], size_text(row), fixed(row["z_max"], 1), threads_text(row)};
  if (row.contains("error")) {
    cells.push_back(row["error"]);
  } else {
    const auto& time = row["time_ms"];
    cells.push_back(std::to_string(int(row["frames"])));
    for (const char* figure : {"median", "p95", "max", "rsd_percent"}) cells.push_back(fixed(time[figure], 1));
    cells.push_back(fixed(row["cpu_ms"]["median"], 1));
    cells.push_back(std::to_string(std::size_t(row["surfels"])));
    cells.push_back(fixed(double(row["working_bytes"]) / 1e6, 1));
  }
  table.row(cells);
}

/// Prints a table with a line for each stage and a column for each of `rows`.
void print_stages(const std::vector<ordered_json>& rows) {
  std::vector<std::string> heads = {"stage"}, names;
  std::vector<ordered_json> stages;
  for (const ordered_json& row : rows) {
    if (row.contains("error")) continue;
    heads.push_back(size_text(row) + " " + fixed(row["z_max"], 0) + "m " + threads_text(row));
    stages.push_back(row["time_ms"]["stages"]);
    for (const auto& [name, time] : stages.back().items())
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  if (stages.empty()) return;
  const Table table("Stages of " + std::string(rows.front()["input"]) + ", median ms on the device (size, z_max, threads)", heads);
  for (const std::string& name : names) {
    std::vector<std::string> cells = {name};
    for (const ordered_json& row : stages) cells.push_back(row.contains(name) ? fixed(row[name]["median"], 2) : "-");
    table.row(cells);
  }
}

}  // namespace

ordered_json measure_frames(const Options& options, const std::vector<Input>& inputs) {
  ordered_json all = ordered_json::array();
  for (const Input& input : inputs) {
    std::vector<ordered_json> rows;
    const Table table("Whole frames, ms a frame",
                      {"input", "size", "z_max", "threads", "frames", "median", "p95", "max", "rsd %", "CPU", "surfels", "working MB"});
    for (Config config : sizes(input, options.quick)) {
      for (const double z_max : options.quick ? std::vector<double>{3} : std::vector<double>{3, 8}) {
        for (const int threads : {1, 0}) {
          if (replay::stop_requested()) break;
          config.z_max = z_max;
          config.threads = threads;
          rows.push_back(measure_row(options, input, config));
          print_row(table, rows.back());
        }
      }
    }
    if (!rows.empty()) print_stages(rows);
    for (ordered_json& row : rows) all.push_back(std::move(row));
  }
  return all;
}

}  // namespace frontier_surfels::bench
