/// A frame with the stages up to the visit of its surfels.
#pragma once

#include "frame_fixture.hpp"
#include "stages/observed_space.hpp"
#include "stages/surfel_split.hpp"
#include "stages/surfel_visit.hpp"

namespace frontier_surfels {

struct VisitFixture : FrameFixture {
  explicit VisitFixture(const Config& config, Commands& commands = test_commands())
      : FrameFixture(config, commands),
        space(commands),
        observed(commands),
        candidates(commands),
        visit(commands),
        splitting(commands, lists()) {}

  /// Begins a frame with its own observed space and candidates.
  void begin_and_observe(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera) {
    begin(image, T_world_camera);
    space.compute(camera());
    find_candidates(space.bits());
  }

  /// @param with  observed space; the ends of columns always come from the image
  void find_candidates(const BitField& with) { candidates.find(camera().grid(), with); }

  SurfelVisit::Found look(const BitField& with) {
    visit.visit(frame(), camera(), with, space.column_end(), views(), taken(), map(), candidates);
    return SurfelVisit::read_found(candidates, map());
  }
  SurfelVisit::Found look() { return look(space.bits()); }

  /// Splits the large surfels that look() has found, and looks again. @return number of added surfels
  std::size_t split() {
    const std::size_t added = splitting.split(frame(), visit.large(), map());
    find_candidates(space.bits());
    look();
    return added;
  }

  std::vector<std::uint32_t> in_view_slots() const { return access().slots(visit.in_view()); }

  ObservedSpace space;
  BitField observed;  ///< for tests that provide C~ themselves
  Candidates candidates;
  SurfelVisit visit;
  SurfelSplit splitting;
};

}  // namespace frontier_surfels
