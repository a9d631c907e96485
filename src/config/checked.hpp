/// A configuration that a mapper can use.
#pragma once

#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/paths.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// @throws Error  all problems, a line each, if there are any
inline void refuse(const std::vector<std::string>& problems) {
  std::string all;
  for (const std::string& problem : problems) all += (all.empty() ? "" : "\n") + problem;
  if (!all.empty()) throw Error(all);
}

/// The configuration, with an absolute path of its map folder. @throws Error  all problems that it has
inline Config checked(const Config& config) {
  refuse(config.problems());
  Config checked = config;
  checked.map_folder = absolute_path(config.map_folder);
  return checked;
}

}  // namespace frontier_surfels
