/// What all stages of a frame share: the structure that kernels are given, and sizes of launches and buffers.
#pragma once

#include "common/shared.h"
#include "frame/camera.hpp"
#include "frame/recent_views.hpp"
#include "map/map_window.hpp"
#include "map/seen_points.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

/// The part of a frame's structure that questions about points of a window need. The camera's frame is the window's.
/// @param seen  null: seen points are not asked
Frame make_frame(const MapWindow& window, const SeenPoints* seen);

/// Makes the structure that every kernel of a frame is given (kernels/common/shared.h). @param seen  null: seen points are not asked
Frame make_frame(const Camera& camera, const MapWindow& window, const RecentViews& views, const SeenPoints* seen, const Limits& limits);

/// A bit for each voxel of the grid (kernels/common/grid.cl says where), or for each surfel of the window's pages.
using BitField = DeviceArray<cl_ulong>;

/// @name Sizes of launches and of buffers
/// @{
constexpr std::size_t kGroup = 64;  ///< work items of a group, unless a kernel needs another number
inline std::size_t tiles(int size) { return (size + VIEW_TILE - 1) / VIEW_TILE; }  ///< tiles of VIEW_TILE voxels along an axis
inline std::size_t words(const Grid& g) { return static_cast<std::size_t>(g.size_i) * g.size_j * g.words_k; }  ///< words of a bit field
inline std::size_t tile_columns(const Grid& g) { return tiles(g.size_i) * tiles(g.size_j) * g.words_k; }  ///< tiles that are one word deep
/// @}

}  // namespace frontier_surfels
