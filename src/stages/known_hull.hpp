/// Known state hull - paper, supplement C: the states in which paths enter the grid; kernels/stages/10_known_hull.cl.
#pragma once

#include "map/surfel_map.hpp"
#include "stages/frame.hpp"
#include "stages/needed_paths.hpp"

namespace frontier_surfels {

class KnownHull {
 public:
  explicit KnownHull(Commands& commands);

  /// Surfels further than this from the grid, in ranges z_max, say nothing of the paths that enter it.
  static constexpr double kReach = 1;

  void compute(const Frame& frame, const NeededPaths& needed, const SurfelMap& map);

  /// A bit for each path that enters through a face, face after face (kernels/stages/10_known_hull.cl: hull_word_offset); right on the
  /// needed paths.
  const BitField& states() const { return states_; }
  static std::size_t size(const Grid& grid);

 private:
  Commands& commands_;
  DeviceArray<cl_uint> near_pages_, faces_;
  BitField states_;
};

}  // namespace frontier_surfels
