#include "ros/input/parameter_table.hpp"

#include "ros/input/parameters.hpp"

namespace frontier_surfels {

std::string node_parameter_table() {
  ParameterTable table;
  const NodeConfig defaults;
  for_each_node_field(defaults, [&table](FieldInfo info, const auto& value) {
    info.group = "ROS node";
    table(info, value);
  });
  return table.text();
}

}  // namespace frontier_surfels
