/// The node's parameters: those of the mapper, and those of its place among ROS nodes.
#pragma once

#include <ros/node_handle.h>

#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"

namespace frontier_surfels {

/// Everything under `~`.
struct NodeConfig {
  Config mapper;
  std::string world_frame = "map";
  std::string image_transport = "raw";
  bool use_color = true;
  std::string color_transport = "raw";
  double tf_timeout = 0.2;
  std::string on_time_jump = "keep";
  double publish_period = 1.0;
  int marker_limit = 100000;

  /// Every fault, one sentence each, the mapper's included; empty when the configuration can be used.
  std::vector<std::string> problems() const;
};

/// visit(FieldInfo, field) for every field of NodeConfig but the mapper's, in order; see for_each_field.
template <typename ConfigT, typename Visitor>
void for_each_node_field(ConfigT& config, Visitor&& visit) {
  visit(FieldInfo{"world_frame", "", "tf frame of the map"}, config.world_frame);
  visit(FieldInfo{"image_transport", "", "of the depth images: raw, compressedDepth, or any other that is installed"},
        config.image_transport);
  visit(FieldInfo{"use_color", "", "occupied surfels take the colour of color/image, registered to depth, where there is one"},
        config.use_color);
  visit(FieldInfo{"color_transport", "", "of the colour images: raw, compressed, or any other that is installed"}, config.color_transport);
  visit(FieldInfo{"tf_timeout", "s", "how long an image waits for its pose", 0, 10}, config.tf_timeout);
  visit(FieldInfo{"on_time_jump", "", "when time goes back, as with a looping bag: keep or reset the map"}, config.on_time_jump);
  visit(FieldInfo{"publish_period", "s", "whole clouds and markers are published at most this often; large maps less often", 0.05, 3600},
        config.publish_period);
  visit(FieldInfo{"marker_limit", "surfel", "discs shown by ~markers; beyond that they are merged to larger ones", 100, 10000000},
        config.marker_limit);
}

/// Reads all parameters of `pnh`'s namespace. @throws Error with every fault: wrong types, values out of range
/// @param warnings  a sentence for every parameter there that is none of ours, with the nearest name
NodeConfig read_parameters(const ros::NodeHandle& pnh, std::vector<std::string>* warnings);

/// Reads the mapper's parameters of a node that runs already, by its name. @throws Error
Config read_mapper_config(const std::string& node);

}  // namespace frontier_surfels
