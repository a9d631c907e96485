/// Known state hull - paper, supplement C: the states in which paths enter the grid; kernels/stages/12_known_hull.cl.
#pragma once

#include "map/surfel_map.hpp"
#include "stages/frame.hpp"
#include "stages/needed_paths.hpp"

namespace frontier_surfels {

class KnownHull {
 public:
  explicit KnownHull(Commands& commands);

  /// Only surfels within this distance of the grid count, in units of z_max.
  static constexpr double kReach = 1;

  void compute(const Frame& frame, const NeededPaths& needed, const SurfelMap& map);

  /// A bit for each path that enters the grid: is it in known space there? Faces follow each other (hull_word_offset in
  /// kernels/stages/12_known_hull.cl). Only the bits of needed paths are valid.
  const BitField& states() const { return states_; }
  static std::size_t size(const Grid& grid);

 private:
  Commands& commands_;
  DeviceArray<cl_uint> near_pages_, faces_;
  BitField states_;
};

}  // namespace frontier_surfels
