/// The cells of the grid of states, found on the device: kernels/planner/state_cells.cl.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/shared.h"
#include "map/block_key.hpp"
#include "map/map_window.hpp"
#include "opencl/commands.hpp"
#include "planner/point_states.hpp"

namespace frontier_surfels {

/// A bit for each cell of a block of the grid, in words of 4 x 4 x 4 cells: the kernel file says where.
using CellBits = std::array<cl_ulong, STATE_BLOCK_CUBES>;

/// The same in rows of 16 cells along x: [z][y].
using CellRows = std::array<std::uint16_t, 256>;

class StateCells {
 public:
  /// A block of the grid whose free cells are to be found.
  struct FreeQuestion {
    BlockKey block;
    CellBits* free;         ///< in: cells that were free; out: those that are
    bool may_lose = false;  ///< points may have been taken since
  };

  /// A block of the grid, and the cells through which frontier and occupied surfels pass.
  struct Marks {
    BlockKey block;
    CellRows frontier = {}, occupied = {};
  };

  explicit StateCells(Commands& commands);

  /// Adds the cells whose centres seen points know, or kept views that came after the view number `after`.
  /// @param edge  of a block of the grid [m]
  void find_free(std::vector<FreeQuestion>& questions, double edge, std::uint64_t after, const KnownWorld& world);

  /// Where surfels pass. @param asked  blocks; their marks must be empty. @param edge  of a block of the grid [m]
  void mark(std::vector<Marks>& asked, double edge, const SurfelMap& map);

 private:
  void find_free_in(const MapWindow& window, const std::vector<FreeQuestion*>& questions, double edge, std::uint64_t after,
                    const KnownWorld& world);
  void mark_in(const BlockKey& first, const BlockKey& last, const std::vector<Marks*>& asked, double edge, const SurfelMap& map);

  Commands& commands_;
  SentArray<cl_float4> blocks_;
  DeviceArray<cl_ulong> bits_;
  DeviceArray<cl_uint> marks_;
  SentArray<cl_uint> pages_;
};

}  // namespace frontier_surfels
