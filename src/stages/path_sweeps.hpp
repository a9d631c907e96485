/// Sweeps - paper 3.2, Algorithm 1, eq. (5)-(7) - and median - eq. (8); kernels/stages/13_sweeps.cl and 14_median.cl.
#pragma once

#include "stages/candidates.hpp"
#include "stages/frame.hpp"
#include "stages/needed_paths.hpp"

namespace frontier_surfels {

class PathSweeps {
 public:
  explicit PathSweeps(Commands& commands) : commands_(commands), known_(commands) {}

  /// @param events  SignField::events()
  /// @param hull    KnownHull::states()
  void sweep(const Frame& frame, const NeededPaths& needed, const BitField& events, const BitField& hull);

  const BitField& known() const { return known_; }  ///< K', a bit for each voxel; only the bits of needed paths are valid

 private:
  Commands& commands_;
  BitField known_;
};

class Median {
 public:
  explicit Median(Commands& commands) : commands_(commands), filtered_(commands) {}

  /// @param known  K'
  /// @return K~, a bit for each voxel; only the bits of candidates are valid
  const BitField& filter(const Frame& frame, const BitField& known, const Candidates& candidates);

 private:
  Commands& commands_;
  BitField filtered_;
};

}  // namespace frontier_surfels
