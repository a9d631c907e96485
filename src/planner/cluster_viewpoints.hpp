/// Where to stand to see a cluster.
#pragma once

#include <vector>

#include "frontier_surfels/planner/clusters.hpp"

namespace frontier_surfels {

/// The best viewpoints of a cluster, by its points, area, centroid and normal.
std::vector<ClusterViewpoint> find_viewpoints(const Cluster& cluster, const ClusterConfig& config, const Space& space);

/// The cluster's viewpoints, without those that are no longer in the clear.
std::vector<ClusterViewpoint> still_clear(const Cluster& cluster, const ClusterConfig& config, const Space& space);

/// The cluster's viewpoints with what they see of it as it is now, without those that see nothing.
std::vector<ClusterViewpoint> valued(const Cluster& cluster, const ClusterConfig& config, const Space& space);

}  // namespace frontier_surfels
