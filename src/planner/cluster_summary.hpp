/// What a planner is told of a group of cells.
#pragma once

#include "frontier_surfels/planner/clusters.hpp"
#include "planner/cluster_partition.hpp"

namespace frontier_surfels {

/// Without viewpoints.
Cluster summary(std::uint32_t id, const ClusterPartition::Group& group, const ClusterLattice& lattice);

}  // namespace frontier_surfels
