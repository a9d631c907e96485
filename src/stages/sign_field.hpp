/// Inner product sign field D - paper eq. (4), supplement B - and the events that paths meet in it; kernels/stages/11_sign_field.cl.
#pragma once

#include "map/surfel_map.hpp"
#include "opencl/lists.hpp"
#include "stages/frame.hpp"
#include "stages/needed_paths.hpp"

namespace frontier_surfels {

/// The surfels in view, in the coordinates of the grid.
class ViewSurfels {
 public:
  ViewSurfels(Commands& commands, Lists& lists);

  /// @param in_view  SurfelVisit::in_view()
  void place(const Frame& frame, const BitField& in_view, const SurfelMap& map);

  std::size_t count() const { return count_; }
  const DeviceArray<ViewSurfel>& surfels() const { return surfels_; }  ///< [count], ordered by page and slot

 private:
  Commands& commands_;
  Lists& lists_;
  std::size_t count_ = 0;
  DeviceArray<cl_uint> slots_;
  DeviceArray<ViewSurfel> surfels_;
};

class SignField {
 public:
  SignField(Commands& commands, Lists& lists);

  void compute(const Frame& frame, const NeededPaths& needed, const ViewSurfels& surfels);

  /// [3 families][EVENT_PLANES] bit fields; only the bits of needed paths are valid.
  const BitField& events() const { return events_; }
  static std::size_t size(const Grid& grid) { return 3 * EVENT_PLANES * words(grid); }

 private:
  void list_by_tiles(const Frame& frame, const ViewSurfels& surfels, std::size_t tiles);

  Commands& commands_;
  Lists& lists_;
  DeviceArray<cl_uint> tile_begin_, tile_cursor_, tile_surfels_;  ///< lists of the surfels that touch each tile of the grid
  BitField events_;
};

}  // namespace frontier_surfels
