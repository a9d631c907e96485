/// What all stages of one frame are told.
#pragma once

#include "common/shared.h"
#include "frame/camera.hpp"
#include "frame/recent_views.hpp"
#include "map/map_window.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

struct Frame {
  Grid grid;                 ///< of the frame's camera
  Limits limits;             ///< of the method
  Window window;             ///< the map's blocks around the grid
  Transform T_camera_local;  ///< local: the window's frame
  Transform T_local_camera;
  View own_view;  ///< this frame's view, as its own camera sees it
  cl_int has_color = 0;
};

Frame make_frame(const Camera& camera, const MapWindow& window, const RecentViews& views, const Limits& limits);

/// A bit for each voxel of the grid (kernels/common/grid.cl says where), or for each surfel of the window's pages.
using BitField = DeviceArray<cl_ulong>;

/// @name Sizes of launches and of buffers
/// @{
constexpr std::size_t kGroup = 64;  ///< work items of a group, where a kernel does not ask for another number
inline std::size_t tiles(int size) { return (size + VIEW_TILE - 1) / VIEW_TILE; }                              ///< of VIEW_TILE voxels
inline std::size_t words(const Grid& g) { return static_cast<std::size_t>(g.size_i) * g.size_j * g.words_k; }  ///< of a bit field
inline std::size_t tile_columns(const Grid& g) { return tiles(g.size_i) * tiles(g.size_j) * g.words_k; }       ///< tiles one word deep
/// @}

}  // namespace frontier_surfels
