#include "stages/candidates.hpp"

namespace frontier_surfels {

Candidates::Candidates(Commands& commands) : commands_(commands), candidates_(commands), visit_counts_(commands) {
  visit_counts_.allocate(COUNTS);
  visit_counts_.fill("candidates", 0, COUNTS);
}

void Candidates::find(const Grid& g, const BitField& observed) {
  candidates_.allocate(words(g));
  const std::size_t rows = VIEW_TILE * tiles(g.size_j);
  commands_.run("candidates", "find_candidates", commands_.chunks(VIEW_TILE * tiles(g.size_i)) * g.words_k * rows, kGroup, g, observed(),
                candidates_(), visit_counts_());
}

CandidateList::CandidateList(Commands& commands, Lists& lists)
    : commands_(commands), lists_(lists), voxels_(commands), around_(commands), directions_(commands) {}

void CandidateList::list(const Frame& frame, const Camera& camera, const BitField& observed, const Candidates& candidates) {
  const char* stage = "directions";
  lists_.list_bits(stage, candidates.bits(), Candidates::words(frame.grid), voxels_);
  const std::size_t chunks = commands_.chunks(voxels_.room());
  around_.resize(chunks * commands_.lanes());
  directions_.resize(chunks * 3 * commands_.lanes());
  commands_.run(stage, "find_directions", chunks, commands_.shape().heavy_group, frame, camera.layer_depth()(), observed(), voxels_(),
                voxels_.length(), around_(), directions_());
}

}  // namespace frontier_surfels
