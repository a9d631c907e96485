/// The benchmark's command line, checked.
#pragma once

#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"

namespace frontier_surfels::bench {

struct Options {
  std::vector<std::string> inputs;  ///< bags and folders; empty: a synthetic room
  int frames = 100;                 ///< of each input; 0: all
  int octomap_frames = 20;          ///< 0: all of these
  double row_seconds = 120;         ///< a row of a table takes its frames for so long [s]
  std::vector<std::string> sections;
  std::string json;  ///< file; empty: none
  std::string config_file;
  Config config;
  bool quick = false;
  std::string child;  ///< what this process measures for the one that has started it; empty: it is the first
};

}  // namespace frontier_surfels::bench
