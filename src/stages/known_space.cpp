#include "stages/known_space.hpp"

namespace frontier_surfels {

KnownSpace::KnownSpace(Commands& commands, Lists& lists)
    : needed_(commands), surfels_(commands, lists), sign_field_(commands, lists), hull_(commands), sweeps_(commands), median_(commands) {}

const BitField& KnownSpace::compute(const Frame& frame, const BitField& in_view, const Candidates& candidates, const SurfelMap& map) {
  // Paths near a candidate: the others need not be walked
  needed_.mark(frame, candidates);

  // Inner product sign field D, and the events that paths meet in it - eq. (4), supplement B
  surfels_.place(frame, in_view, map);
  sign_field_.compute(frame, needed_, surfels_);

  // States in which paths enter the grid - supplement C
  hull_.compute(frame, needed_, map);

  // K' along each family of paths - Algorithm 1, eq. (5)-(7) -, and its median K~ - eq. (8)
  sweeps_.sweep(frame, needed_, sign_field_.events(), hull_.states());
  return median_.filter(frame, sweeps_.known(), candidates);
}

}  // namespace frontier_surfels
