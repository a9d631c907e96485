/// The parameters of the node: those of the mapper, and those of its inputs and outputs.
#pragma once

#include <ros/node_handle.h>

#include <string>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// All parameters under `~`.
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
  std::string cloud_confidence = "frontier";
  int message_limit = 16000000;
  double planner_resolution = 0.05;
  double planner_period = 0.5;
  double cluster_min_area = 0.05;
  double cluster_max_extent = 1.0;
  double view_distance = 1.2;
  double view_clearance = 0.3;
  double projected_min_z = 0.1;
  double projected_max_z = 1.5;

  /// Every fault, one sentence each, the mapper's included; empty when the configuration can be used.
  std::vector<std::string> problems() const;

  /// The label that cloud_confidence names.
  Label confident_label() const { return cloud_confidence == "occupied" ? Label::kOccupied : Label::kFrontier; }
};

/// Calls visit(FieldInfo, field) for every field of NodeConfig except `mapper`, in order; see for_each_field.
template <typename ConfigT, typename Visitor>
void for_each_node_field(ConfigT& config, Visitor&& visit) {
  visit(FieldInfo{"world_frame", "", "tf frame of the map"}, config.world_frame);
  visit(FieldInfo{"image_transport", "",
                  "transport of the depth images: raw, compressedDepth, or another one that is installed; else the node does not start"},
        config.image_transport);
  visit(FieldInfo{"use_color", "", "whether occupied surfels take their colour from color/image, which must be registered to depth"},
        config.use_color);
  visit(FieldInfo{"color_transport", "",
                  "transport of the colour images: raw, compressed, or another one that is installed; else the node does not start"},
        config.color_transport);
  visit(FieldInfo{"tf_timeout", "s", "how long an image waits for its pose and its camera_info", 0, 10}, config.tf_timeout);
  visit(FieldInfo{"on_time_jump", "", "what becomes of the map when time jumps back, as when a bag loops: keep or reset"},
        config.on_time_jump);
  visit(FieldInfo{"publish_period", "s", "shortest time between two whole clouds or markers; it is longer for large maps", 0.05, 3600},
        config.publish_period);
  visit(FieldInfo{"marker_limit", "surfel", "maximum number of discs in ~markers; beyond it, surfels are merged to larger discs", 100,
                  10000000},
        config.marker_limit);
  visit(FieldInfo{"cloud_confidence", "", "which surfels have confidence 1 in point clouds, all others having 0: frontier or occupied"},
        config.cloud_confidence);
  visit(FieldInfo{"message_limit", "surfel",
                  "maximum number of surfels in a message: larger updates come in parts; of 16 million, a message has at most 0.9 GB, "
                  "because roscpp refuses more than 1 GB",
                  1000, 16000000},
        config.message_limit);
  visit(FieldInfo{"planner_resolution", "m", "edge of a cell of ~states_update, ~octomap_full and ~projected_map", 0.02, 1},
        config.planner_resolution);
  visit(FieldInfo{"planner_period", "s", "shortest time between two messages of ~states_update, ~clusters, ~octomap_full or ~projected_map",
                  0.1, 3600},
        config.planner_period);
  visit(FieldInfo{"cluster_min_area", "m2", "smaller clusters of frontier surfels are not told", 0, 100}, config.cluster_min_area);
  visit(FieldInfo{"cluster_max_extent", "m", "clusters are divided until they are at most as long as this", 0.1, 100},
        config.cluster_max_extent);
  visit(FieldInfo{"view_distance", "m", "distance between a cluster and its viewpoints", 0.1, 100}, config.view_distance);
  visit(FieldInfo{"view_clearance", "m", "distance between a viewpoint and what is not free", 0, 10}, config.view_clearance);
  visit(FieldInfo{"projected_min_z", "m", "lowest height of the band that ~projected_map shows", -1e6, 1e6}, config.projected_min_z);
  visit(FieldInfo{"projected_max_z", "m", "highest height of the band that ~projected_map shows", -1e6, 1e6}, config.projected_max_z);
}

/// Reads all parameters in the namespace of `pnh`.
/// @param warnings  gets a sentence for every unknown parameter there, with the known name that is most like it
/// @throws Error with every fault: wrong types, values out of range
NodeConfig read_parameters(const ros::NodeHandle& pnh, std::vector<std::string>* warnings);

/// Sets every parameter in the namespace of `pnh` to the value that is in force, defaults included, so that `rosparam get` shows it.
void write_parameters(const ros::NodeHandle& pnh, const NodeConfig& config);

/// Reads the parameters of the mapper in a running node of this name. @throws Error with every fault
Config read_mapper_config(const std::string& node);

}  // namespace frontier_surfels
