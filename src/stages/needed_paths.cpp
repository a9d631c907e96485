#include "stages/needed_paths.hpp"

namespace frontier_surfels {

std::size_t NeededPaths::size(const Grid& g) {
  return 2 * static_cast<std::size_t>(g.size_i + g.size_j) * g.words_k + static_cast<std::size_t>(g.size_i) * g.size_j;
}

void NeededPaths::mark(const Frame& frame, const Candidates& candidates) {
  const char* stage = "needed_paths";
  lines_.allocate(size(frame.grid));
  lines_.fill(stage, 0, size(frame.grid));
  commands_.run(stage, "mark_lines", words(frame.grid), kGroup, frame, candidates.bits()(), lines_());
}

}  // namespace frontier_surfels
