/// The arguments of the nodes and of the nodelet.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace frontier_surfels {

/// What is wrong with arguments, as a sentence; empty if there are none. The nodes have no arguments of their own.
/// @param arguments  without the program's name, and without those that ROS takes out: NAME:=VALUE
/// @param program    whose --help lists what there is
std::string fault_of_arguments(const std::vector<std::string>& arguments, const std::string& program = "mapper_node");

/// Answers --help with `help`, and refuses arguments that a node does not have. @return the exit code with which the program ends; none: it
/// goes on
std::optional<int> answer_arguments(int argc, char** argv, const std::string& program, const std::function<std::string()>& help);

}  // namespace frontier_surfels
