/// The arguments of the node and of the nodelet.
#pragma once

#include <string>
#include <vector>

namespace frontier_surfels {

/// What is wrong with arguments, as a sentence; empty if there are none. The mapper has no arguments of its own.
/// @param arguments  without the program's name, and without those that ROS takes out: NAME:=VALUE
std::string fault_of_arguments(const std::vector<std::string>& arguments);

}  // namespace frontier_surfels
