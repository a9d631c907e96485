/// Voxels where new surfels may be created - paper 3.5, eq. (13); kernels/stages/4_candidates.cl and 8_directions.cl.
#pragma once

#include "opencl/lists.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

/// The candidates as a bit field whose words lie tile by tile (kernels/common/grid.cl: tile_word_index). Later stages clear bits of it.
class Candidates {
 public:
  explicit Candidates(Commands& commands);

  /// Finds the unobserved voxels beside observed ones. Voxels with a surfel are among them until SurfelVisit clears them.
  void find(const Grid& g, const BitField& observed);

  static std::size_t words(const Grid& grid) { return VIEW_TILE * VIEW_TILE * tile_columns(grid); }
  const BitField& bits() const { return candidates_; }
  BitField& bits() { return candidates_; }

  /// [COUNTS]: what SurfelVisit counts, and whether the frame goes on. find() sets them to zero, because a launch of its own would cost
  /// more than that work.
  DeviceArray<cl_uint>& visit_counts() { return visit_counts_; }

 private:
  Commands& commands_;
  BitField candidates_;
  DeviceArray<cl_uint> visit_counts_;
};

/// List of the candidates that are left, each with the direction to the observed space around it - paper 3.5, eq. (15). The host need not
/// know how long it is: DeviceList.
class CandidateList {
 public:
  CandidateList(Commands& commands, Lists& lists);

  void list(const Frame& frame, const Camera& camera, const BitField& observed, const Candidates& candidates);

  DeviceList& voxels() { return voxels_; }  ///< number of each, 64 word + bit, ascending
  const DeviceList& voxels() const { return voxels_; }
  const DeviceArray<cl_int>& around() const { return around_; }         ///< a bit for each of the 27 voxels around that is observed
  const DeviceArray<float>& directions() const { return directions_; }  ///< [chunks of LANES][3][LANES]: sums of unit vectors

 private:
  Commands& commands_;
  Lists& lists_;
  DeviceList voxels_;
  DeviceArray<cl_int> around_;
  DeviceArray<float> directions_;
};

}  // namespace frontier_surfels
