/// Measurements that need a process which has done nothing before: the program starts itself.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "bench/input.hpp"
#include "bench/options.hpp"

namespace frontier_surfels::bench {

/// Starts this program with --child `what` on one input, and waits for it.
/// @param kernel_cache  folder in which PoCL keeps built kernels; empty: the one in use
/// @return what it has printed
/// @throws Error        it failed; it has said why
nlohmann::ordered_json run_child(const std::string& what, const Options& options, const Input& input, const std::string& kernel_cache = "");

}  // namespace frontier_surfels::bench
