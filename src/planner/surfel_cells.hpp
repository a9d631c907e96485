/// The surfels of a part of the map, listed cell by cell: kernels/planner/boundaries.cl.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "common/shared.h"
#include "map/map_window.hpp"
#include "map/surfel_map.hpp"
#include "opencl/commands.hpp"
#include "opencl/lists.hpp"

namespace frontier_surfels {

/// The pages of the window's blocks; in no certain order.
std::vector<cl_uint> pages_of(const MapWindow& window, const BlockIndex& index);

class SurfelCells {
 public:
  SurfelCells(Commands& commands, Lists& lists)
      : commands_(commands), lists_(lists), pages_(commands), begin_(commands), entries_(commands) {}

  /// Lists the surfels of all blocks that meet a box of the world [m].
  void list(const Eigen::AlignedBox3d& box_world, const SurfelMap& map);

  bool empty() const { return count_ == 0; }  ///< then the rest is not to be used
  const Window& window() const { return window_.window(); }
  Eigen::Vector3d corner_world() const { return window_.corner_world(); }  ///< of the window [m]
  cl_int cells() const { return cells_; }                                  ///< along a block's edge
  const cl::Buffer& begin() const { return begin_(); }
  const cl::Buffer& entries() const { return entries_(); }

 private:
  Commands& commands_;
  Lists& lists_;
  MapWindow window_;
  cl_int cells_ = 1;
  std::size_t count_ = 0;  ///< of surfels
  SentArray<cl_uint> pages_;
  DeviceArray<cl_uint> begin_;
  DeviceArray<cl_float4> entries_;
};

}  // namespace frontier_surfels
