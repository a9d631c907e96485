/// Surfels and reports as ROS messages.
#pragma once

#include <frontier_surfels/FrameReport.h>
#include <frontier_surfels/SurfelUpdate.h>
#include <sensor_msgs/PointCloud2.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "ros/output/surfel_mirror.hpp"

namespace frontier_surfels::messages {

/// Fields x y z normal_x normal_y normal_z radius (float32), rgb (float32, PCL's packing; 0: no colour was seen), id (uint32),
/// label (uint8; 1 occupied, 0 frontier); 40 bytes a point. Everything of a surfel is in it, bit for bit. The header is left empty.
/// @throws Error if there are more surfels than a cloud can hold
sensor_msgs::PointCloud2 to_cloud(const std::vector<Surfel>& surfels);

/// The same of a whole map, or of one label, ordered by id; makes no copy in between.
sensor_msgs::PointCloud2 to_cloud(const SurfelMirror& map, std::optional<Label> only = std::nullopt);

/// Back again; the fields are found by name. @throws Error if one is missing or of another type, or the data are cut short or damaged
std::vector<Surfel> to_surfels(const sensor_msgs::PointCloud2& cloud);

/// What has changed since number `since`, `box` around it; the header is left empty. @throws Error as to_cloud
frontier_surfels::SurfelUpdate to_message(const Changes& changes, std::uint64_t since, const Eigen::AlignedBox3f& box);

/// counts, times and sequence of `report`; header, result, latency and wait are left to the caller.
frontier_surfels::FrameReport to_message(const Report& report);

}  // namespace frontier_surfels::messages
