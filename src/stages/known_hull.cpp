#include "stages/known_hull.hpp"

#include <algorithm>

namespace frontier_surfels {

KnownHull::KnownHull(Commands& commands) : commands_(commands), near_pages_(commands), faces_(commands), states_(commands) {}

std::size_t KnownHull::size(const Grid& g) {
  const std::size_t i = g.size_i, j = g.size_j, w = g.words_k;
  return 2 * (j * w + i * w + i * j);
}

void KnownHull::compute(const Frame& frame, const NeededPaths& needed, const SurfelMap& map) {
  const char* stage = "known_hull";
  const std::size_t i = frame.grid.size_i, j = frame.grid.size_j, k = frame.grid.size_k, w = frame.grid.words_k;
  const std::size_t cells = 2 * (j * k + i * k + i * j);
  faces_.allocate(cells);
  states_.allocate(size(frame.grid));
  faces_.fill(stage, 0xffffffffU, cells);
  const std::size_t pages = map.list_pages_near(kReach * frame.grid.z_max, near_pages_);
  commands_.run(stage, "project_hull", PAGE_SLOTS / commands_.lanes() * pages, kGroup, frame.grid, frame.limits, frame.window,
                frame.T_camera_local, near_pages_(), static_cast<cl_uint>(pages), map.alive(), map.page_block(), map.surfels(),
                needed.lines()(), faces_());
  const std::size_t most = std::max({j * w, i * w, i * j});
  commands_.run(stage, "hull_states", cl::NDRange((most + kGroup - 1) / kGroup * kGroup, 6), cl::NDRange(kGroup, 1), frame.grid, faces_(),
                states_());
}

}  // namespace frontier_surfels
