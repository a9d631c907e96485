#include "stages/path_sweeps.hpp"

namespace frontier_surfels {

void PathSweeps::sweep(const Frame& frame, const NeededPaths& needed, const BitField& events, const BitField& hull) {
  const char* stage = "sweeps";
  const std::size_t i = frame.grid.size_i, j = frame.grid.size_j, w = frame.grid.words_k;
  known_.allocate(words(frame.grid));
  commands_.run(stage, "sweep_i", j * w, kGroup, frame, needed.lines()(), events(), hull(), known_());
  commands_.run(stage, "sweep_j", i * w, kGroup, frame, needed.lines()(), events(), hull(), known_());
  commands_.run(stage, "sweep_k", i * j, kGroup, frame, needed.lines()(), events(), hull(), known_());
}

const BitField& Median::filter(const Frame& frame, const BitField& known, const Candidates& candidates) {
  filtered_.allocate(words(frame.grid));
  commands_.run("median", "median", words(frame.grid), kGroup, frame, known(), candidates.bits()(), filtered_());
  return filtered_;
}

}  // namespace frontier_surfels
