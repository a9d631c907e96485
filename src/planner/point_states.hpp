/// States of points, for planners: kernels/planner/states.cl.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/shared.h"
#include "frame/recent_views.hpp"
#include "frontier_surfels/planner/states.hpp"
#include "map/map_window.hpp"
#include "map/seen_points.hpp"
#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"
#include "stages/taking_back.hpp"

namespace frontier_surfels {

/// The memory that answers questions about points.
struct KnownWorld {
  RecentViews& views;
  SeenPoints& seen;
  TakingBack& taking_back;
  const SurfelMap& map;
  bool use_seen;  ///< Config::seen_points
};

/// Sends the tables of seen and taken points of a window's blocks. @return what kernels are told of the window
Frame open_window(const MapWindow& window, const KnownWorld& world);

class PointStates {
 public:
  explicit PointStates(Commands& commands);

  /// The states of points, in the order of the points. What the last frame has forgotten must have been remembered.
  /// @throws Error  a point is not finite
  std::vector<SpaceState> find(const std::vector<Eigen::Vector3f>& points_world, const KnownWorld& world);

 private:
  struct Sorted;
  void find_some(const std::vector<Eigen::Vector3f>& points, const std::vector<std::uint32_t>& asked, const KnownWorld& world,
                 std::vector<SpaceState>& states);
  void mark_occupied(const MapWindow& window, const std::vector<Eigen::Vector3f>& points, const std::vector<std::uint32_t>& asked,
                     const Sorted& sorted, const SurfelMap& map);

  Commands& commands_;
  SentArray<float> points_;
  SentArray<cl_int4> chunks_;
  SentArray<cl_int> cell_begin_;
  SentArray<cl_uint> pages_;
  DeviceArray<cl_uchar> states_;
};

}  // namespace frontier_surfels
