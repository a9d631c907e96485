/// Section "long": the frames of an input walked to and fro for hours of a robot's time, in windows: does a frame cost more, or is the map
/// worse, once most views have been forgotten?
#include <algorithm>

#include "apps/interrupt.hpp"
#include "bench/measured_run.hpp"
#include "bench/sections.hpp"
#include "bench/table.hpp"
#include "frontier_surfels/scoring/exact_test.hpp"

namespace frontier_surfels::bench {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kWarmFrames = 5;  // the first frames are not counted
constexpr std::size_t kLongWindow = 500;

std::vector<replay::RecordedFrame> read_all(const Input& input) {
  const auto source = input.open();
  std::vector<replay::RecordedFrame> frames;
  while (auto frame = source->next()) frames.push_back(*frame);
  return frames;
}

/// Number of the n-th frame of a walk from the first to the last of `count` frames, back, and so on.
std::size_t to_and_fro(std::size_t n, std::size_t count) {
  if (count == 1) return 0;
  const std::size_t at = n % (2 * count - 2);
  return at < count ? at : 2 * count - 2 - at;
}

ordered_json exact_json(const scoring::ExactScore& score) {
  return {{"right", score.right},     {"buried", score.buried},     {"within_2v", score.within_2v},
          {"fdr_5cm", score.fdr_5cm}, {"miss_2cm", score.miss_2cm}, {"miss_5cm", score.miss_5cm}};
}

void print_row(const Table& table, const ordered_json& row) {
  const auto& exact = row["exact"];
  table.row({row["input"], std::to_string(std::size_t(row["first_frame"])), fixed(row["time_ms"]["median"], 1),
             fixed(row["time_ms"]["p95"], 1), fixed(row["time_ms"]["max"], 1), std::to_string(std::size_t(row["surfels"])),
             fixed(double(row["seen_bytes"]) / 1e6, 1), fixed(100 * double(exact["right"]), 2), fixed(100 * double(exact["buried"]), 2),
             fixed(100 * double(exact["fdr_5cm"]), 3), fixed(100 * double(exact["miss_2cm"]), 3)});
}

}  // namespace

ordered_json measure_long(const Options& options, const std::vector<Input>& inputs) {
  ordered_json rows = ordered_json::array();
  const Table table("Long walks to and fro, ms a frame and the exact test of the whole map (%)",
                    {"input", "from frame", "median", "p95", "max", "surfels", "seen MB", "right", "buried", "fdr_5cm", "miss_2cm"});
  for (const Input& input : inputs) {
    const Config config = input.config(kUsualWidth);
    const std::vector<replay::RecordedFrame> frames = read_all(input);
    scoring::ExactTest exact(config);  // of the frames that have come so far
    Mapper mapper(config);
    const std::size_t length = options.quick ? 20 : static_cast<std::size_t>(options.long_frames),
                      window = options.quick ? 10 : kLongWindow;
    std::vector<double> times;
    for (std::size_t n = 0; n < length && !replay::stop_requested(); ++n) {
      const DepthFrame frame = frames[to_and_fro(n, frames.size())].view();
      if (n < frames.size()) exact.add(frame);
      const Report report = mapper.integrate(frame);
      if (n >= kWarmFrames) times.push_back(report.total_ms);
      if ((n + 1) % window != 0 && n + 1 != length) continue;
      rows.push_back({{"input", input.name()},
                      {"first_frame", n / window * window},
                      {"time_ms", statistics_json(times)},
                      {"surfels", report.surfels},
                      {"map_bytes", report.map_bytes},
                      {"seen_bytes", report.seen_bytes},
                      {"working_bytes", working_memory(report)},
                      {"exact", exact_json(exact.score(mapper.surfels()))}});
      print_row(table, rows.back());
      times.clear();
    }
  }
  return rows;
}

}  // namespace frontier_surfels::bench
