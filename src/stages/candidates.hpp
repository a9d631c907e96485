/// Voxels where new surfels may be created - paper 3.5, eq. (13); kernels/stages/2_candidates.cl and 6_directions.cl.
#pragma once

#include "opencl/lists.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

/// The candidates as bits, in words that lie tile by tile (kernels/common/grid.cl: tile_word_index). Stages take bits off.
class Candidates {
 public:
  explicit Candidates(Commands& commands);

  /// Unobserved voxels beside observed ones. Those with a surfel are among them: the visit of the surfels takes them off.
  /// @param counters  COUNTS numbers of SurfelVisit, set to zero by this launch: one of their own would cost more than its work
  void find(const Frame& frame, const BitField& observed, DeviceArray<cl_uint>& counters);

  static std::size_t words(const Grid& grid) { return VIEW_TILE * VIEW_TILE * tile_columns(grid); }
  const BitField& bits() const { return candidates_; }
  BitField& bits() { return candidates_; }

 private:
  Commands& commands_;
  BitField candidates_;
};

/// The candidates that are left, as a list, each with the direction to the observed space around it - paper 3.5, eq. (15).
class CandidateList {
 public:
  CandidateList(Commands& commands, Lists& lists);

  void list(const Frame& frame, const Camera& camera, const BitField& observed, const Candidates& candidates);

  std::size_t count() const { return count_; }
  const DeviceArray<cl_uint>& voxels() const { return voxels_; }        ///< [count]: 64 word + bit, ascending
  const DeviceArray<cl_int>& around() const { return around_; }         ///< [count]: the observed ones of the 27 voxels around, a bit each
  const DeviceArray<float>& directions() const { return directions_; }  ///< [chunks of LANES][3][LANES]: sums of unit vectors

 private:
  Commands& commands_;
  Lists& lists_;
  std::size_t count_ = 0;
  DeviceArray<cl_uint> voxels_;
  DeviceArray<cl_int> around_;
  DeviceArray<float> directions_;
};

}  // namespace frontier_surfels
