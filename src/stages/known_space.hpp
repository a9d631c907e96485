/// Known space K~ from the surfels - paper 3.2, Algorithm 1, supplements B and C; kernels/stages/10_needed_paths.cl to 14_median.cl.
///
/// Decides about the candidates that no kept view knows. Its fields take more memory than those of all other stages together, so a mapper
/// makes a KnownSpace only once views have been forgotten.
#pragma once

#include "map/surfel_map.hpp"
#include "opencl/lists.hpp"
#include "stages/candidates.hpp"
#include "stages/frame.hpp"
#include "stages/known_hull.hpp"
#include "stages/path_sweeps.hpp"
#include "stages/sign_field.hpp"

namespace frontier_surfels {

class KnownSpace {
 public:
  KnownSpace(Commands& commands, Lists& lists);

  /// @param in_view  SurfelVisit::in_view()
  /// @return K~, a bit for each voxel; only the bits of candidates are valid
  const BitField& compute(const Frame& frame, const BitField& in_view, const Candidates& candidates, const SurfelMap& map);

 private:
  NeededPaths needed_;
  ViewSurfels surfels_;
  SignField sign_field_;
  KnownHull hull_;
  PathSweeps sweeps_;
  Median median_;
};

}  // namespace frontier_surfels
