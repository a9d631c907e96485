/// Section "map_size": the same frames in maps of 1 to 50 million surfels, which are the mapped room and copies of it side by side. A
/// loaded map has no kept views at first, and what has been seen is filled in.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "apps/interrupt.hpp"
#include "bench/measured_run.hpp"
#include "bench/sections.hpp"
#include "bench/table.hpp"
#include "replay/summary.hpp"

namespace frontier_surfels::bench {
namespace {

using nlohmann::ordered_json;

constexpr double kMillion = 1e6;

/// Times of the warm frames.
struct Times {
  std::vector<double> wall_ms, cpu_ms;
};

/// Cells of a plane for the copies of the room, in growing rings around the room itself, which is the first.
std::vector<Eigen::Vector2i> cells_around(std::size_t count) {
  std::vector<Eigen::Vector2i> cells;
  for (int ring = 0; cells.size() < count; ++ring) {
    for (int x = -ring; x <= ring; ++x) {
      for (int y = -ring; y <= ring; ++y)
        if (std::max(std::abs(x), std::abs(y)) == ring) cells.emplace_back(x, y);
    }
  }
  cells.resize(count);
  return cells;
}

/// Copies of the room until there are at least `wanted` surfels. The copies are so far apart that no view sees two of them: the number of
/// surfels near the view is the same in all maps.
std::vector<Surfel> tiled(const std::vector<Surfel>& room, double wanted, double z_max) {
  Eigen::AlignedBox3f box;
  for (const Surfel& surfel : room) box.extend(surfel.position);
  const Eigen::Vector3f size = box.sizes();
  std::array<int, 3> axes = {0, 1, 2};
  std::stable_sort(axes.begin(), axes.end(), [&](int a, int b) { return size[a] > size[b]; });
  const float gap = static_cast<float>(z_max) + 1;

  const auto cells = cells_around(static_cast<std::size_t>(std::ceil(wanted / static_cast<double>(room.size()))));
  std::vector<Surfel> surfels;
  surfels.reserve(cells.size() * room.size());
  for (const Eigen::Vector2i& cell : cells) {
    Eigen::Vector3f offset = Eigen::Vector3f::Zero();
    for (int n = 0; n < 2; ++n) offset[axes[n]] = static_cast<float>(cell[n]) * (size[axes[n]] + gap);
    for (Surfel surfel : room) {
      surfel.position += offset;
      surfels.push_back(surfel);
    }
  }
  return surfels;
}

std::vector<Surfel> map_room(const Options& options, const Input& input, const Config& config) {
  const auto source = input.open();
  Mapper mapper(config);
  run_frames(mapper, input, *source, options);
  return mapper.surfels();
}

ordered_json measure_row(const Options& options, const Input& input, const std::vector<Surfel>& room, double millions, Times& times) {
  const Config config = input.config(kUsualWidth);
  ordered_json row = {{"input", input.name()}, {"millions", millions}};
  attempt(row, [&] {
    const auto source = input.open();
    Mapper mapper(config);
    mapper.load(tiled(room, millions * kMillion, config.z_max));  // a temporary, freed before frames are measured
    row["loaded"] = mapper.size();
    const auto run = run_frames(mapper, input, *source, options);
    add_figures(run, row);
    for (const auto& frame : replay::warm_frames(run.frames)) {
      times.wall_ms.push_back(frame.report.total_ms);
      times.cpu_ms.push_back(frame.cpu_ms);
    }
  });
  return row;
}

/// Adds the ratio of the medians over the frames that both runs have mapped, if there are any.
void add_ratio(std::vector<double> times, std::vector<double> smallest, const char* name, ordered_json& row) {
  const std::size_t both = std::min(times.size(), smallest.size());
  if (both == 0) return;
  times.resize(both);
  smallest.resize(both);
  row[name] = replay::time_statistics(times).median / replay::time_statistics(smallest).median;
}

void print_row(const Table& table, const ordered_json& row) {
  std::vector<std::string> cells = {row["input"], fixed(row["millions"], 2)};
  if (row.contains("error")) {
    cells.push_back(row["error"]);
  } else {
    cells.push_back(std::to_string(std::size_t(row["loaded"])));
    cells.push_back(std::to_string(int(row["frames"])));
    for (const char* figure : {"median", "p95"}) cells.push_back(fixed(row["time_ms"][figure], 1));
    cells.push_back(fixed(row["cpu_ms"]["median"], 1));
    for (const char* ratio : {"ratio_time", "ratio_cpu"}) cells.push_back(row.contains(ratio) ? fixed(row[ratio], 2) : "-");
    cells.push_back(fixed(row["bytes_a_surfel"], 1));
    cells.push_back(fixed(double(row["working_bytes"]) / kMillion, 1));
  }
  table.row(cells);
}

}  // namespace

ordered_json measure_map_size(const Options& options, const std::vector<Input>& inputs) {
  ordered_json rows = ordered_json::array();
  const auto sizes = options.quick ? std::vector<double>{0.01, 0.5} : std::vector<double>{1, 5, 20, 50};
  for (const Input& input : inputs) {
    if (replay::stop_requested()) break;
    std::vector<Surfel> room;
    ordered_json fault = {{"input", input.name()}, {"millions", sizes.front()}};
    attempt(fault, [&] { room = map_room(options, input, input.config(kUsualWidth)); });
    const Table table(
        "The same frames in maps of several sizes, ms a frame",
        {"input", "million", "surfels", "frames", "median", "p95", "CPU", "ratio", "CPU ratio", "bytes a surfel", "working MB"});
    if (fault.contains("error")) {
      print_row(table, fault);
      rows.push_back(std::move(fault));
      continue;
    }
    Times smallest;
    for (const double millions : sizes) {
      if (replay::stop_requested()) break;
      Times times;
      ordered_json row = measure_row(options, input, room, millions, times);
      if (millions == sizes.front()) smallest = times;
      add_ratio(times.wall_ms, smallest.wall_ms, "ratio_time", row);
      add_ratio(times.cpu_ms, smallest.cpu_ms, "ratio_cpu", row);
      print_row(table, row);
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

}  // namespace frontier_surfels::bench
