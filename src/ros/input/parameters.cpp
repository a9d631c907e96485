#include "ros/input/parameters.hpp"

#include <ros/names.h>

#include "frontier_surfels/types.hpp"
#include "ros/input/conversions.hpp"
#include "ros/input/parameter_reader.hpp"

namespace frontier_surfels {
std::vector<std::string> NodeConfig::problems() const {
  std::vector<std::string> faults = mapper.problems();
  for_each_node_field(*this, RangeCheck(faults));
  if (messages::strip_slash(world_frame).empty())
    faults.push_back("world_frame is empty: it must be the tf frame in which the map does not move.");
  if (!(projected_min_z < projected_max_z))
    faults.push_back("projected_min_z is not below projected_max_z: ~projected_map shows the heights between them.");
  if (on_time_jump != "keep" && on_time_jump != "reset")
    faults.push_back("on_time_jump is '" + on_time_jump + "': it must be keep or reset.");
  if (use_color && color_transport == "compressedDepth")
    faults.push_back("color_transport is compressedDepth, which is for depth images: choose raw or compressed.");
  if (cloud_confidence != "frontier" && cloud_confidence != "occupied")
    faults.push_back("cloud_confidence is '" + cloud_confidence + "': it must be frontier or occupied.");
  return faults;
}

NodeConfig read_parameters(const ros::NodeHandle& pnh, std::vector<std::string>* warnings) {
  NodeConfig config;
  std::string faults;
  auto parameters = list_parameters(pnh.getNamespace());
  for_each_field(config.mapper, ParameterReader(parameters, faults));
  for_each_node_field(config, ParameterReader(parameters, faults));
  for (const std::string& problem : config.problems()) faults += problem + "\n";
  throw_if_any(faults);
  config.world_frame = messages::strip_slash(config.world_frame);

  std::vector<std::string> names;
  for_each_node_field(config, [&](const FieldInfo& info, const auto&) { names.emplace_back(info.name); });
  for (const auto& entry : parameters) {
    if (warnings != nullptr) warnings->push_back("There is no parameter ~" + entry.first + suggestion(entry.first, names));
  }
  return config;
}

void write_parameters(const ros::NodeHandle& pnh, const NodeConfig& config) {
  const auto write = [&pnh](const FieldInfo& info, const auto& value) { pnh.setParam(info.name, value); };
  for_each_field(config.mapper, write);
  for_each_node_field(config, write);
}

Config read_mapper_config(const std::string& node) {
  Config config;
  std::string faults;
  auto parameters = list_parameters(ros::names::resolve(node));
  for_each_field(config, ParameterReader(parameters, faults));
  for (const std::string& problem : config.problems()) faults += problem + "\n";
  throw_if_any(faults);
  return config;
}

}  // namespace frontier_surfels
