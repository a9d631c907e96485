/// What planners ask and get, as ROS messages.
#pragma once

#include <frontier_surfels/EvaluateViews.h>
#include <frontier_surfels/FrontierCluster.h>
#include <frontier_surfels/StatesUpdate.h>
#include <frontier_surfels/ViewResult.h>
#include <nav_msgs/OccupancyGrid.h>

#include <Eigen/Geometry>

#include "frontier_surfels/planner/clusters.hpp"
#include "frontier_surfels/planner/state_grid.hpp"
#include "frontier_surfels/planner/views.hpp"

namespace frontier_surfels::messages {

using ViewValueMessage = frontier_surfels::ViewResult;

/// Headers are left empty.
frontier_surfels::StatesUpdate to_message(const StateChanges& changes);

frontier_surfels::FrontierCluster to_message(const Cluster& cluster);
ViewValueMessage to_message(const ViewValue& value);

/// Poses that are not poses stay so: Mapper::evaluate_views() refuses them. @throws Error  a quaternion is not of unit length
ViewQuestion to_question(const frontier_surfels::EvaluateViewsRequest& request);

/// The cells between two heights [m] from above: occupied (100) where one of them is, else free (0) where one of them is, else unknown
/// (-1). The header is left empty.
nav_msgs::OccupancyGrid projected(const StateGrid& grid, double min_z, double max_z);

}  // namespace frontier_surfels::messages
