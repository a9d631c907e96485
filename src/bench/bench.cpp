/// bench: measures what a frame costs in time and memory; prints tables and writes JSON.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <set>
#include <thread>

#include "apps/command.hpp"
#include "apps/interrupt.hpp"
#include "bench/measured_run.hpp"
#include "bench/sections.hpp"
#include "frontier_surfels/mapper.hpp"
#include "frontier_surfels/paths.hpp"
#include "replay/summary.hpp"

namespace frontier_surfels::bench {

const std::vector<Section>& sections() {
  static const std::vector<Section> all = {
      {"frames", "whole frames for several image sizes, depth ranges and numbers of threads", measure_frames},
      {"stages", "one frame repeated: the steadiest times of the stages", measure_stages},
      {"octomap", "OctoMap's insertPointCloud on the same frames, for comparison", measure_octomap},
      {"map_size", "frames in maps of 1 to 50 million surfels", measure_map_size},
      {"long", "10 000 frames to and fro, in windows of 500: time, and the exact test of the map", measure_long},
      {"start", "start-up with and without compiled kernels in the cache", measure_start},
      {"memory", "memory of the map, of everything else on the device, and of the process", measure_memory},
  };
  return all;
}

namespace {

using nlohmann::ordered_json;

void declare_options(CLI::App& app, Options& options) {
  std::vector<std::string> names;
  std::string footer = "Sections (all of them are measured unless --only names some):\n";
  for (const Section& section : sections()) {
    names.push_back(section.name);
    footer += "  " + names.back() + std::string(10 - names.back().size(), ' ') + section.what + "\n";
  }
  app.footer(footer);
  app.add_option("INPUT", options.inputs, "bags or folders, as replay_score takes them; none: a synthetic room")
      ->check(replay::not_empty());
  app.add_option("--frames", options.frames, "use the first N frames of each input, default 100; 0: all")
      ->type_name("N")
      ->check(replay::whole_number(0));
  app.add_option("--only", options.sections, "measure only these sections, which are listed below")
      ->type_name("SECTION...")
      ->check(replay::one_of(names));
  app.add_option("--octomap-frames", options.octomap_frames, "number of frames for OctoMap, evenly spaced, default 20; 0: all")
      ->type_name("N")
      ->check(replay::whole_number(0));
  app.add_option("--long-frames", options.long_frames, "number of frames of the section long, default 10000")
      ->type_name("N")
      ->check(replay::whole_number(1));
  app.add_option("--row-seconds", options.row_seconds, "end a row of a table after S seconds, default 120")
      ->type_name("S")
      ->check(replay::positive_number());
  app.add_option("--config", options.config_file,
                 "YAML file with parameters of the mapper; bench itself sets decimation, and z_max and threads where it varies them")
      ->type_name("FILE.yaml")
      ->check(replay::not_empty());
  app.add_option("--json", options.json, "write all numbers to this file")->type_name("FILE")->check(replay::not_empty());
  app.add_flag("--quick", options.quick, "only check that everything runs, with a few small frames; the numbers mean nothing");
  app.add_option("--child", options.child)->check(replay::one_of({"start", "memory"}))->group("");  // see child_process.hpp
}

/// @throws CLI::Error (also for help, with exit code 0), Error
Options parse(int argc, char** argv) {
  Options options;
  CLI::App app("Measures what a frame costs: prints tables, and writes JSON.", "bench");
  declare_options(app, options);
  replay::read_arguments(app, {argv + 1, argv + argc}, [&] {
    app.parse(argc, argv);
    for (std::string& input : options.inputs) input = absolute_path(input);
    for (std::string* path : {&options.config_file, &options.json}) *path = absolute_path(*path);
    if (!options.config_file.empty()) options.config = load_config(options.config_file);
    std::string problems;
    for (const std::string& problem : options.config.problems()) problems += problem + "\n";
    if (!problems.empty()) throw replay::wrong_usage(problems);
  });
  constexpr int kQuickFrames = 4;
  if (options.quick && (options.frames == 0 || options.frames > kQuickFrames)) options.frames = kQuickFrames;
  return options;
}

bool wanted(const Options& options, const Section& section) {
  return options.sections.empty() || std::find(options.sections.begin(), options.sections.end(), section.name) != options.sections.end();
}

/// Prints what is wrong with the inputs, each sentence once. @throws EmptyMap if a map is empty
void tell_faults(const ordered_json& sections) {
  std::set<std::string> told;
  std::string empty;
  for (const auto& rows : sections) {
    for (const auto& row : rows) {
      if (row.contains("empty_map") && empty.empty()) empty = row["error"];
      for (const std::string sentence : row.value("warnings", ordered_json::array()))
        if (told.insert(row["input"].get<std::string>() + sentence).second)
          std::cout << "WARNING     " << row["input"].get<std::string>() << ": " << sentence << "\n";
    }
  }
  if (!empty.empty()) throw EmptyMap(empty);
}

void measure(const Options& options) {
  const std::vector<Input> inputs = open_inputs(options);
  std::string device, choice;
  {
    const Mapper mapper(options.config);
    device = mapper.device();
    choice = mapper.device_choice();
  }
  ordered_json json = {{"device", device},
                       {"processors", std::thread::hardware_concurrency()},
                       {"frames", options.frames},
                       {"quick", options.quick},
                       {"complete", false},
                       {"config", replay::config_json(options.config)},
                       {"sections", ordered_json::object()}};
  const auto write = [&] {
    if (!options.json.empty()) replay::write_file(options.json, json.dump(2) + "\n");
  };
  write();  // fails now, rather than after hours, if the file cannot be written
  replay::catch_first_interrupt();
  std::cout << "Device: " << device << " (" << choice << ")" << std::endl;
  for (const Section& section : sections()) {
    if (!wanted(options, section) || replay::stop_requested()) continue;
    json["sections"][section.name] = section.measure(options, inputs);
    write();
  }
  json["complete"] = !replay::stop_requested();
  write();
  tell_faults(json["sections"]);
  if (replay::stop_requested())
    std::cerr << "Stopped. What was measured so far is printed above, and is in the JSON file if --json was given.\n";
}

void measure_as_child(const Options& options) {
  replay::catch_first_interrupt();
  const Input input = open_inputs(options).front();
  std::cout << (options.child == "start" ? child_start(input) : child_memory(options, input)) << "\n";
}

}  // namespace
}  // namespace frontier_surfels::bench

int main(int argc, char** argv) {
  using namespace frontier_surfels;
  return replay::run_command("bench", "leave out map_size (--only), or take fewer frames (--frames).", [&] {
    const bench::Options options = bench::parse(argc, argv);
    options.child.empty() ? bench::measure(options) : bench::measure_as_child(options);
  });
}
