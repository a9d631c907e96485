/// Surfels on their way into the map.
#pragma once

#include "opencl/commands.hpp"

namespace frontier_surfels {

struct NewSurfels {
  explicit NewSurfels(Commands& commands) : surfels(commands), cells(commands) {}
  void resize(std::size_t count) {
    surfels.resize(count);
    cells.resize(count);
  }

  DeviceArray<cl_uint4> surfels;  ///< packed (kernels/common/surfels.cl)
  DeviceArray<cl_uint> cells;     ///< cell of the map's window, that is the block, of each surfel
};

}  // namespace frontier_surfels
