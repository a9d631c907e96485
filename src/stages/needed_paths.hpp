/// The paths of the grid that section 3.2 of the paper must walk: those near a candidate; kernels/stages/10_needed_paths.cl.
#pragma once

#include "stages/candidates.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

class NeededPaths {
 public:
  explicit NeededPaths(Commands& commands) : commands_(commands), lines_(commands) {}

  void mark(const Frame& frame, const Candidates& candidates);

  /// Marks of three families: paths along i [size_j][words_k] and along j [size_i][words_k] have a bit for each layer k, as 32-bit halves;
  /// paths along k [size_j][size_i] have a number each.
  const DeviceArray<cl_uint>& lines() const { return lines_; }
  static std::size_t size(const Grid& grid);

 private:
  Commands& commands_;
  DeviceArray<cl_uint> lines_;
};

}  // namespace frontier_surfels
