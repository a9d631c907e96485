/// Clusters of frontier surfels as markers for rviz.
#pragma once

#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

#include <vector>

#include "frontier_surfels/planner/clusters.hpp"

namespace frontier_surfels {

/// For each cluster its points in a colour of its own, which depends on its id, its number, and arrows at its viewpoints. The message
/// begins with a DELETEALL.
visualization_msgs::MarkerArray cluster_markers(const std_msgs::Header& header, const std::vector<Cluster>& clusters);

}  // namespace frontier_surfels
