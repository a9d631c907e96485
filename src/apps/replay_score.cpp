/// replay_score: maps a recording, scores the map, and writes a report.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <optional>

#include "apps/command.hpp"
#include "apps/interrupt.hpp"
#include "config/config_text.hpp"
#include "frontier_surfels/paths.hpp"
#include "frontier_surfels/ply.hpp"
#include "opencl/device_listing.hpp"
#include "replay/live_replay.hpp"
#include "replay/report_folder.hpp"
#include "replay/report_page.hpp"
#include "replay/run.hpp"
#include "replay/summary.hpp"
#include "replay/sweep.hpp"
#include "replay/warnings.hpp"
#ifdef FRONTIER_SURFELS_WITH_ROS
#include "ros/input/parameter_table.hpp"
#endif

namespace frontier_surfels::replay {
namespace {

namespace fs = std::filesystem;

/// The options after all checks.
struct Options {
  Recording recording;
  std::string report;  ///< folder of the report
  std::string truth;   ///< folder of what an ideal sensor would have seen; empty: none
  Config config;
  OctomapResolution octomap_resolution;
  bool exact = true;
  std::optional<Sweep> sweep;
  std::optional<LiveOptions> live;
};

/// Options as given on the command line, before they become a Config, a Sweep and LiveOptions.
struct RawOptions {
  std::string config_file;
  std::vector<std::string> settings;
  std::optional<int> threads;
  std::string sweep;
  std::string mapper;
  std::string octomap_resolution = "auto";
  bool no_exact = false;
  bool live = false;
};

/// doc/parameters.md is this text.
void print_parameters() {
  std::cout
      << "# Parameters\n\n"
         "This file is the output of `replay_score --parameters`: do not edit it. The terms are explained in [method.md](method.md).\n\n"
         "Parameters are set in a YAML file (`--config FILE.yaml` of the programs, `config:=FILE.yaml` of the launch files), one by one\n"
         "(`--set NAME=VALUE` of replay_score), under `~` of the ROS node, or in C++ as members of `frontier_surfels::Config`. They are\n"
         "checked together at the start, and cannot be changed later. [config](../config) has such files, among them those with the range "
         "and\n"
         "the sensor model of the first Kinect, of RealSense D400 and of time-of-flight cameras.\n"
      << parameter_table();
#ifdef FRONTIER_SURFELS_WITH_ROS
  std::cout << node_parameter_table();
#endif
}

void declare_options(CLI::App& app, Options& options, RawOptions& raw) {
  SourceOptions& source = options.recording.options;
  app.add_option("INPUT", options.recording.path, "a bag, or a folder (TUM RGB-D layout, or depth/ + poses.txt + camera.txt)")
      ->required()
      ->check(not_empty());
  app.add_option("--report", options.report, "folder for the report; made if it is missing")
      ->required()
      ->type_name("DIR")
      ->check(not_empty());
  app.add_option("--config", raw.config_file, "YAML file with parameters of the mapper")->type_name("FILE.yaml")->check(not_empty());
  app.add_option("--set", raw.settings, "set one parameter of the mapper; can be repeated")
      ->type_name("key=value")
      ->allow_extra_args(false);
  app.add_option("--first", source.first, "index of the first frame")->type_name("N")->check(whole_number(0));
  app.add_option("--last", source.last, "index of the last frame; -1: the end")->type_name("N")->check(whole_number(-1));
  app.add_option("--stride", source.stride, "use every N-th frame")->type_name("N")->check(whole_number(1));
  app.add_option("--depth-topic", source.depth_topic, "bags: topic of the depth images")->type_name("T");
  app.add_option("--info-topic", source.info_topic, "bags: topic of the depth camera's camera_info")->type_name("T");
  app.add_option("--color-topic", source.color_topic, "bags: topic of the colour images")->type_name("T");
  app.add_option("--world-frame", source.world_frame, "bags: tf frame of the map")->type_name("F");
  app.add_option("--octomap-resolution", raw.octomap_resolution,
                 "voxel size [m] of the OctoMap that is built for comparison; 0: none; default auto: the distance between pixels at z_max, "
                 "where OctoMap has no gaps between rays")
      ->type_name("M");
  app.add_option(
         "--truth", options.truth,
         "folder with the same frames as an ideal sensor would have seen them, such as the truth/ that make_synthetic writes: the map is "
         "judged by these as well")
      ->type_name("FOLDER")
      ->check(not_empty());
  app.add_flag("--no-exact", raw.no_exact, "leave out the exact test");
  app.add_option("--threads", raw.threads, "number of threads of the mapper and the scores; 0: all")
      ->type_name("N")
      ->check(whole_number(0));
  app.add_option("--sweep", raw.sweep, "repeat the run for N values of a parameter from LO to HI")
      ->type_name("PARAM=LO:HI:N")
      ->check(not_empty());
  app.add_flag("--live", raw.live, "bags: publish the recording to a running mapper node, and score the map that the node publishes");
  app.add_option("--mapper", raw.mapper, "name of that node, default: mapper")->type_name("NAME")->needs("--live")->check(not_empty());
  app.add_flag_callback(
      "--parameters",
      [] {
        print_parameters();
        throw CLI::Success();
      },
      "print all parameters, as in doc/parameters.md");
  app.add_flag_callback(
      "--devices",
      [] {
        std::cout << device_listing();
        throw CLI::Success();
      },
      "list the OpenCL devices, the fastest first, with what each lacks, and the one that is used by default");
}

/// @throws CLI::ValidationError with every fault of the settings and the configuration
void read_config(const RawOptions& raw, Config& config) {
  if (!raw.config_file.empty()) config = load_config(raw.config_file);
  std::string problems;
  for (const std::string& setting : raw.settings) {
    const auto equals = setting.find('=');
    try {
      if (equals == std::string::npos) throw Error("--set '" + setting + "' is not of the form key=value.");
      set_field(config, setting.substr(0, equals), setting.substr(equals + 1));
    } catch (const Error& error) {
      problems += std::string(error.what()) + "\n";
    }
  }
  if (raw.threads) config.threads = *raw.threads;
  for (const std::string& problem : config.problems()) problems += problem + "\n";
  if (!problems.empty()) throw wrong_usage(problems);
}

/// @throws CLI::ValidationError
OctomapResolution octomap_resolution(const std::string& text) {
  if (text == "auto") return std::nullopt;
  double resolution = NAN;
  // The upper bound rejects values in millimetres, the lower one those that would fill any memory. NaN fails both comparisons.
  if (!from_text(text, resolution) || (resolution != 0 && !(resolution >= 1e-4 && resolution <= 10)))
    throw CLI::ValidationError("--octomap-resolution", "must be auto, 0, or from 0.0001 to 10 m, not '" + text + "'.");
  return resolution;
}

/// @throws CLI::ValidationError if parameters of the mapper are given: a running mapper has its own
LiveOptions live_options(const RawOptions& raw, const std::vector<std::string>& ros_arguments) {
  if (!raw.config_file.empty() || !raw.settings.empty() || raw.threads || !raw.sweep.empty()) {
    throw CLI::ValidationError("--live",
                               "the running mapper has parameters of its own: set them where it is started, and leave out --config, --set, "
                               "--threads and --sweep.");
  }
  LiveOptions live;
  if (!raw.mapper.empty()) live.mapper = raw.mapper;
  live.ros_arguments = ros_arguments;
  return live;
}

/// @throws CLI::Error (also for help, with exit code 0), Error
Options parse(int argc, char** argv) {
  Options options;
  RawOptions raw;
  std::vector<std::string> arguments(std::make_reverse_iterator(argv + argc),
                                     std::make_reverse_iterator(argv + 1));  // CLI11 takes them in reverse
  const auto is_ours = [](const std::string& argument) { return argument.find(":=") == std::string::npos; };
  const auto ros = std::stable_partition(arguments.begin(), arguments.end(), is_ours);  // roslaunch adds some with ':='
  const std::vector<std::string> ros_arguments(ros, arguments.end());
  arguments.erase(ros, arguments.end());
  CLI::App app("Maps a recording, scores the map, and writes summary.json, frames.csv, surfels.ply, octomap.ply and report.html.",
               "replay_score");
  declare_options(app, options, raw);
  read_arguments(app, {arguments.rbegin(), arguments.rend()}, [&] {
    app.parse(arguments);
    // With --report=~/x and in launch files no shell has expanded the `~`.
    for (std::string* path : {&options.recording.path, &options.report, &options.truth, &raw.config_file}) *path = absolute_path(*path);
    const int last = options.recording.options.last;
    if (last >= 0 && last < options.recording.options.first) throw CLI::ValidationError("--last", "is before --first.");
    options.octomap_resolution = octomap_resolution(raw.octomap_resolution);
    read_config(raw, options.config);
    options.exact = !raw.no_exact;
    if (raw.live) options.live = live_options(raw, ros_arguments);
    if (!raw.sweep.empty()) try {
        options.sweep = parse_sweep(raw.sweep, options.config);
      } catch (const Error& error) {
        throw wrong_usage(error.what());
      }
  });
  return options;
}

/// Writes what is known before the map is scored, so that it is kept if the program is ended while it scores.
void write_map(const fs::path& folder, const Run& run) {
  write_ply(folder / "surfels.ply", run.surfels);
  write_file(folder / "frames.csv", frames_csv(run.frames));
  write_file(folder / "trajectory.txt", trajectory_text(run.frames));
}

void write_scores(const fs::path& folder, const Yardsticks& yardsticks, const Scores& scores, const nlohmann::ordered_json& summary) {
  if (scores.octomap) write_ply(folder / "octomap.ply", yardsticks.octomap_boundary());
  if (scores.exact)
    write_file(folder / "verdicts.bin", std::string(reinterpret_cast<const char*>(scores.verdicts.data()), scores.verdicts.size()));
  write_file(folder / "summary.json", summary.dump(2) + "\n");
}

/// Prints the first few reasons: many frames are often skipped for the same one.
void tell_skipped(const std::vector<std::string>& skipped) {
  constexpr std::size_t kShown = 5;
  for (std::size_t i = 0; i < std::min(skipped.size(), kShown); ++i) std::cerr << "Skipped a frame: " << skipped[i] << "\n";
  if (skipped.size() > kShown) std::cerr << "... and " << skipped.size() - kShown << " more.\n";
}

/// Makes the page beside the other new files. They are kept if that fails.
void make_page(ReportFolder& folder) {
  try {
    make_report_page(folder.unfinished(), folder.kept());
  } catch (const Error&) {
    folder.keep();
    throw;
  }
}

void replay_and_score(const Options& options) {
  catch_first_interrupt();
  auto live = options.live ? open_live_replay(options.recording, *options.live, stop_requested) : nullptr;
  const Config config = live ? live->config() : options.config;
  const auto truth = options.truth.empty() ? nullptr : std::make_shared<TruthFolder>(options.truth, options.recording.path);
  ReportFolder folder(options.report);

  Yardsticks yardsticks(config, options.octomap_resolution, options.exact, truth);
  const Run run = live ? live->map(&yardsticks, stop_requested) : map_recording(options.recording, config, &yardsticks, stop_requested);
  live.reset();  // disconnects: the mapper must not send to a program that is busy scoring
  tell_skipped(run.skipped);
  if (run.stopped)
    std::cerr << "Stopped after " << run.frames.size() << " frames, which are now scored and written. Press Ctrl-C again to end at once.\n";
  write_map(folder.unfinished(), run);

  const bool is_empty = run.surfels.empty();
  const Scores scores = is_empty ? Scores() : score(run.surfels, yardsticks, config.threads);
  const auto summary = summary_json(options.recording, run, yardsticks, scores);
  write_scores(folder.unfinished(), yardsticks, scores, summary);
  std::cout << result_table(summary) << std::flush;

  if (options.sweep && !run.stopped && !is_empty) {
    const auto sweep = run_sweep(*options.sweep, options.recording, yardsticks, options.octomap_resolution, stop_requested);
    write_file(folder.unfinished() / "sweep.json", sweep.dump(2) + "\n");
  }
  make_page(folder);
  folder.commit();
  std::cout << "report      " << (fs::path(options.report) / "report.html").string() << "\n";
  if (!run.unsaved.empty()) throw FileError(run.unsaved);
  if (is_empty) throw empty_map(options.recording.path, warnings(run));
}

}  // namespace
}  // namespace frontier_surfels::replay

int main(int argc, char** argv) {
  using namespace frontier_surfels::replay;
  return run_command("replay_score", "leave out the OctoMap (--octomap-resolution 0) or replay fewer frames (--last, --stride).",
                     [&] { replay_and_score(parse(argc, argv)); });
}
