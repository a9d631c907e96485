/// Section "stages": one frame is integrated repeatedly into a map that contains it already. These are the steadiest figures, for comparing
/// a kernel before and after a change.
#include <benchmark/benchmark.h>

#include <algorithm>

#include "apps/interrupt.hpp"
#include "bench/measured_run.hpp"
#include "bench/sections.hpp"
#include "bench/table.hpp"
#include "replay/summary.hpp"

namespace frontier_surfels::bench {
namespace {

using nlohmann::ordered_json;

constexpr int kRepetitions = 5;

/// Keeps the medians over the repetitions and prints nothing.
class Medians : public benchmark::BenchmarkReporter {
 public:
  explicit Medians(ordered_json& row) : row_(row) {}
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.aggregate_name == "stddev") row_["stddev_ms"] = run.GetAdjustedRealTime();
      if (run.aggregate_name != "median") continue;
      row_["time_ms"] = run.GetAdjustedRealTime();
      row_["cpu_ms"] = run.GetAdjustedCPUTime();
      for (const auto& [name, counter] : run.counters) row_["stages"][name] = counter.value;
    }
  }

 private:
  ordered_json& row_;
};

/// @param fault  gets the message if the mapper throws: exceptions cannot pass through Google Benchmark
void integrate_again(benchmark::State& state, Mapper& mapper, const DepthFrame& frame, std::string& fault) {
  for (auto _ : state) {
    try {
      for (const StageTime& stage : mapper.integrate(frame).stages) state.counters[stage.name] += stage.ms;
      if (replay::stop_requested()) fault = "Interrupted.";
    } catch (const std::exception& error) {
      fault = error.what();
    }
    if (fault.empty()) continue;
    state.SkipWithError(fault.c_str());
    break;
  }
  for (auto& [name, counter] : state.counters) counter.flags = benchmark::Counter::kAvgIterations;
}

ordered_json measure_row(const Options& options, const Input& input, const Config& config) {
  ordered_json row = {{"input", input.name()}, {"threads", config.threads}, {"recent_views", config.recent_views}};
  attempt(row, [&] {
    Config timed = config;
    timed.stage_times_every = 1;
    Mapper mapper(timed);
    const auto source = input.open();
    const auto run = run_frames(mapper, input, *source, options);
    for (const std::string& name : replay::stage_names(run.frames)) row["stages"][name] = 0;  // puts them in order
    const auto frame = input.open(1)->next();
    if (!frame) throw Error("The first frame could not be read again.");

    std::string fault;
    benchmark::RegisterBenchmark("integrate", [&](benchmark::State& state) { integrate_again(state, mapper, frame->view(), fault); })
        ->Unit(benchmark::kMillisecond)
        ->MeasureProcessCPUTime()
        ->UseRealTime()
        ->MinTime(options.quick ? 0.01 : 1)
        ->Repetitions(options.quick ? 2 : kRepetitions)
        ->ReportAggregatesOnly();
    Medians medians(row);
    benchmark::RunSpecifiedBenchmarks(&medians);
    benchmark::ClearRegisteredBenchmarks();
    if (!fault.empty()) throw Error(fault);
  });
  return row;
}

/// Prints a table with a line for each stage and a column for each of `rows`.
void print(const Input& input, const std::vector<ordered_json>& rows) {
  std::vector<std::string> heads = {"stage"}, names, whole = {"whole frame"}, cpu = {"CPU"}, spread = {"deviation"};
  std::vector<ordered_json> good;
  for (const ordered_json& row : rows) {
    if (row.contains("error")) {
      std::printf("%s: %s\n", input.name().c_str(), std::string(row["error"]).c_str());
      continue;
    }
    good.push_back(row);
    heads.push_back(std::to_string(int(row["recent_views"])) + " views, " + (row["threads"] == 0 ? "all" : "1") + " thr.");
    whole.push_back(fixed(row["time_ms"], 2));
    cpu.push_back(fixed(row["cpu_ms"], 2));
    spread.push_back(fixed(row["stddev_ms"], 2));
    for (const auto& [name, ms] : row["stages"].items())
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  if (good.empty()) return;
  const Table table("One frame of " + input.name() + " repeated, ms (kept views, threads)", heads);
  for (const std::string& name : names) {
    std::vector<std::string> cells = {name};
    for (const ordered_json& row : good) cells.push_back(row["stages"].contains(name) ? fixed(row["stages"][name], 2) : "-");
    table.row(cells);
  }
  for (const auto& cells : {whole, cpu, spread}) table.row(cells);
}

}  // namespace

ordered_json measure_stages(const Options& options, const std::vector<Input>& inputs) {
  ordered_json all = ordered_json::array();
  for (const Input& input : inputs) {
    std::vector<ordered_json> rows;
    Config config = input.config(kUsualWidth);
    // Without recent views the surfels are asked in every frame, so that all kernels run: these rows have every stage.
    for (const int views : {0, config.recent_views}) {
      for (const int threads : {1, 0}) {
        if (replay::stop_requested()) break;
        config.recent_views = views;
        config.seen_points = views > 0;  // without views: the paper's known space
        config.threads = threads;
        rows.push_back(measure_row(options, input, config));
      }
    }
    print(input, rows);
    for (ordered_json& row : rows) all.push_back(std::move(row));
  }
  return all;
}

}  // namespace frontier_surfels::bench
