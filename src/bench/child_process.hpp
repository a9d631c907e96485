/// Start-up and memory can only be measured in a process that has done nothing before: the program starts itself anew.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "bench/input.hpp"
#include "bench/options.hpp"

namespace frontier_surfels::bench {

/// Starts this program with the option --child `what` on one input, and waits until it ends.
/// @param kernel_cache  folder in which PoCL keeps compiled kernels; empty: the one of this process
/// @return the JSON that it has printed
/// @throws Error        if it failed; it has then printed why
nlohmann::ordered_json run_child(const std::string& what, const Options& options, const Input& input, const std::string& kernel_cache = "");

}  // namespace frontier_surfels::bench
