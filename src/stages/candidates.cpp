#include "stages/candidates.hpp"

namespace frontier_surfels {

Candidates::Candidates(Commands& commands) : commands_(commands), candidates_(commands) {}

void Candidates::find(const Frame& frame, const BitField& observed, DeviceArray<cl_uint>& counters) {
  const Grid& g = frame.grid;
  candidates_.allocate(words(g));
  counters.resize(COUNTS);
  const std::size_t rows = VIEW_TILE * tiles(g.size_j);
  commands_.run("candidates", "find_candidates", commands_.chunks(VIEW_TILE * tiles(g.size_i)) * g.words_k * rows, kGroup, frame,
                observed(), candidates_(), counters());
}

CandidateList::CandidateList(Commands& commands, Lists& lists)
    : commands_(commands), lists_(lists), voxels_(commands), around_(commands), directions_(commands) {}

void CandidateList::list(const Frame& frame, const Camera& camera, const BitField& observed, const Candidates& candidates) {
  const char* stage = "directions";
  count_ = lists_.list_bits(stage, candidates.bits(), Candidates::words(frame.grid), voxels_);
  const std::size_t chunks = commands_.chunks(count_);
  around_.resize(chunks * commands_.lanes());
  directions_.resize(chunks * 3 * commands_.lanes());
  commands_.run(stage, "find_directions", chunks, commands_.shape().heavy_group, frame, camera.layer_depth()(), observed(), voxels_(),
                static_cast<cl_int>(count_), around_(), directions_());
}

}  // namespace frontier_surfels
