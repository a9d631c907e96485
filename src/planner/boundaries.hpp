/// The boundary of known space, for planners: near points, and in the way of boxes. kernels/planner/boundaries.cl.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "frontier_surfels/planner/states.hpp"
#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"
#include "opencl/lists.hpp"
#include "planner/surfel_cells.hpp"

namespace frontier_surfels {

/// A box with edges along the axes that moves straight, or stands still.
struct MovingBox {
  Eigen::Vector3f from, to;   ///< its centre at the start and at the end, world frame [m]
  Eigen::Vector3f half_size;  ///< [m]
};

/// The first surfel that comes to lie within a moving box. Of surfels that come at once, an occupied one.
struct FirstSurfel {
  float share = 2;                 ///< of the way, from 0 to 1; 2: there is none
  Label label = Label::kFrontier;  ///< of the surfel
};

class Boundaries {
 public:
  Boundaries(Commands& commands, Lists& lists);

  /// See Mapper::nearest_boundaries(). @throws Error  a point is not finite, the reach makes no sense, or there are too many points
  std::vector<NearestBoundary> nearest(const std::vector<Eigen::Vector3f>& points_world, double reach, const SurfelMap& map);

  /// @param frontier_counts  does the first frontier surfel count? Otherwise occupied ones alone
  std::vector<FirstSurfel> first_within(const std::vector<MovingBox>& boxes, bool frontier_counts, const SurfelMap& map);

 private:
  void look_in_cells(const std::vector<Eigen::Vector3f>& points_world, const std::vector<std::uint32_t>& asked,
                     const Eigen::AlignedBox3d& box, double reach, const SurfelMap& map);
  void look_in_blocks(const std::vector<Eigen::Vector3f>& points_world, const std::vector<std::uint32_t>& asked, double reach,
                      const MapWindow& window, const SurfelMap& map);
  std::size_t send_points(const std::vector<Eigen::Vector3f>& points_world, const std::vector<std::uint32_t>& asked,
                          const Eigen::Vector3d& corner);

  Commands& commands_;
  SurfelCells cells_;
  SentArray<float> points_, near_squares_;
  SentArray<cl_uint> pages_, page_begin_, near_begin_, near_;
  SentArray<cl_float4> boxes_;
  DeviceArray<float> distances_;
  DeviceArray<cl_uint> slots_;
  DeviceArray<cl_uchar> sides_;
};

}  // namespace frontier_surfels
