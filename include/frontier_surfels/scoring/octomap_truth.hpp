/// The paper's own yardstick (4.1.2, 4.2.1): an OctoMap built from the same frames, and its boundary surfels M.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/planner/state_grid.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

/// Comparison of a cloud Psi with OctoMap's M at a distance tolerance (5 cm in the paper).
struct OctomapScore {
  std::size_t surfels = 0;  ///< |M|
  std::size_t fp = 0;       ///< of Psi, further than the tolerance from every M
  std::size_t fn = 0;       ///< of M, further than the tolerance from every Psi
  double fdr = 0;           ///< fp / |Psi|
  double for_ = 0;          ///< fn / |M|
};

/// What an insertion took [ms].
struct InsertionTime {
  double wall_ms = 0;
  double cpu_ms = 0;
};

class OctomapTruth {
 public:
  /// @param resolution  side of a voxel [m]
  /// @param config      says how the mapper reads depth images: z_min, z_max, decimation, depth_unit and what is carved
  /// @throws Error      if these make no sense
  OctomapTruth(double resolution, const Config& config);
  ~OctomapTruth();

  /// Inserts a frame's points as insertPointCloud does. Where the mapper carves up to z_max, the ray is free up to there, like the rays
  /// that insertPointCloud cuts at its maximum range. @return what that took, without the making of the point cloud
  InsertionTime add(const DepthFrame& frame);

  /// M: unknown voxels that are 6-neighbours of known (free or occupied) ones - eq. (17)-(18): one surfel at the centre of each. Normal:
  /// the normalised sum of unit vectors to the known voxels among the 26 neighbours; radius sqrt(3)/2 resolution; label occupied when a
  /// 6-neighbour is occupied in OctoMap, else frontier.
  std::vector<Surfel> boundary() const;

  /// The whole tree as a grid of cells as large as its voxels, for planners. @param sequence  the number that the grid gets
  StateChanges states(std::uint64_t sequence) const;

  OctomapScore score(const std::vector<Surfel>& psi, const std::vector<Surfel>& m, double tolerance = 0.05) const;

  double memory_mb() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace frontier_surfels::scoring
