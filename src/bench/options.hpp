/// The benchmark's options after all checks.
#pragma once

#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"

namespace frontier_surfels::bench {

struct Options {
  std::vector<std::string> inputs;  ///< bags and folders; empty: a synthetic room
  int frames = 100;                 ///< used of each input; 0: all
  int octomap_frames = 20;          ///< used for OctoMap; 0: all of `frames`
  int long_frames = 10000;          ///< of the section "long"
  double row_seconds = 120;         ///< longest time for one row of a table [s]
  std::vector<std::string> sections;
  std::string json;  ///< file; empty: none
  std::string config_file;
  Config config;
  bool quick = false;
  std::string child;  ///< what this process measures for its parent; empty: it is not a child
};

}  // namespace frontier_surfels::bench
