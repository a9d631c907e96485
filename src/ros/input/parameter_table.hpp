/// The node's own parameters as text. No ROS is needed to include this.
#pragma once

#include <string>

namespace frontier_surfels {

/// The table of those parameters that only the node has, not the mapper in it; see parameter_table().
std::string node_parameter_table();

}  // namespace frontier_surfels
