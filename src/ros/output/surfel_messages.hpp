/// Surfels and reports as ROS messages.
#pragma once

#include <frontier_surfels/FrameReport.h>
#include <frontier_surfels/SurfelUpdate.h>
#include <sensor_msgs/PointCloud2.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "ros/output/surfel_mirror.hpp"

namespace frontier_surfels::messages {

/// A cloud of surfels in the layout of pcl::PointSurfel, 48 bytes a point. All fields are float32, except id and label, which are uint32:
///   x 0, y 4, z 8, id 12, normal_x 16, normal_y 20, normal_z 24, label 28, rgb 32, radius 36, confidence 40, curvature 44
/// label is 1 for occupied and 0 for frontier; curvature is 0. rgb is PCL's packing. A surfel without a colour is shown blue if it is
/// frontier and grey if it is occupied, and the highest byte of its rgb is 1 instead of 0. to_surfels() thus gives back every surfel bit
/// for bit. The header is left empty.
/// @param confident  surfels of this label have confidence 1, all others 0
/// @param most       maximum number of surfels
/// @throws Error if there are more surfels; it says how to get them
sensor_msgs::PointCloud2 to_cloud(const std::vector<Surfel>& surfels, Label confident = Label::kFrontier, std::size_t most = kMostSurfels);

/// The same for a whole map or the surfels of one label, ordered by id. The surfels are not copied in between.
sensor_msgs::PointCloud2 to_cloud(const SurfelMirror& map, Label confident = Label::kFrontier, std::optional<Label> only = std::nullopt,
                                  std::size_t most = kMostSurfels);

/// The surfels of such a cloud. Fields are found by their names; confidence and curvature need not be there.
/// @throws Error if a field is missing or of another type, or the data are cut short or damaged
std::vector<Surfel> to_surfels(const sensor_msgs::PointCloud2& cloud);

/// Makes the messages of an update, one after the other, in the order of their parts. All removed ids come before, or together with, the
/// first surfels. Headers are left empty.
class UpdateMessages {
 public:
  /// The changes of the map since sequence number `since`, with the box around them. They must outlive this object.
  /// @param most  maximum number of surfels, and of removed ids, in a message
  UpdateMessages(const Changes& changes, std::uint64_t since, const Eigen::AlignedBox3f& box, Label confident, std::size_t most);

  /// The whole map, which must outlive this object and stay as it is.
  UpdateMessages(const SurfelMirror& map, const Eigen::AlignedBox3f& box, Label confident, std::size_t most);

  std::uint32_t size() const { return parts_; }  ///< number of messages; at least one
  bool done() const { return part_ == parts_; }
  frontier_surfels::SurfelUpdate next();

 private:
  void count_parts();

  std::uint64_t sequence_, since_;
  std::function<const Surfel&()> next_surfel_;
  const std::vector<std::uint32_t>& removed_;
  const Eigen::AlignedBox3f box_;
  const Label confident_;
  const std::size_t most_;
  std::size_t surfels_left_, removed_sent_ = 0;
  std::uint32_t part_ = 0, parts_ = 0;
};

/// The report's sequence number, counts and times. Header, result, reason, latency and wait are left empty.
frontier_surfels::FrameReport to_message(const Report& report);

}  // namespace frontier_surfels::messages
