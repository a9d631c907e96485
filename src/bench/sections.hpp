/// The sections of the benchmark. Each prints tables on standard output and returns the same numbers and more as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/input.hpp"
#include "bench/options.hpp"

namespace frontier_surfels::bench {

struct Section {
  const char* name;
  const char* what;
  nlohmann::ordered_json (*measure)(const Options& options, const std::vector<Input>& inputs);  ///< prints tables, returns rows
};

/// All sections in the order in which they are measured.
const std::vector<Section>& sections();

nlohmann::ordered_json measure_frames(const Options& options, const std::vector<Input>& inputs);
nlohmann::ordered_json measure_stages(const Options& options, const std::vector<Input>& inputs);
nlohmann::ordered_json measure_octomap(const Options& options, const std::vector<Input>& inputs);
nlohmann::ordered_json measure_map_size(const Options& options, const std::vector<Input>& inputs);
nlohmann::ordered_json measure_long(const Options& options, const std::vector<Input>& inputs);
nlohmann::ordered_json measure_start(const Options& options, const std::vector<Input>& inputs);
nlohmann::ordered_json measure_memory(const Options& options, const std::vector<Input>& inputs);

/// What the child processes of measure_start() and measure_memory() measure.
nlohmann::ordered_json child_start(const Input& input);
nlohmann::ordered_json child_memory(const Options& options, const Input& input);

}  // namespace frontier_surfels::bench
