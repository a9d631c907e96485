/// Kept views as bytes, for files and for the map folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// How many numbers (double) the bytes of a view begin with: T_world_camera column by column without the last row, the intrinsics, and the
/// step of the depths. Width and height (int32), the number of depths (uint32) and the depths (uint16) follow.
constexpr std::size_t kViewNumbers = 17;

/// @throws FileError  the view has no camera, pose or depths
void check_view(const SavedView& view);

std::vector<std::uint8_t> pack_view(const SavedView& view);

/// @param used  [out] number of bytes that the view takes
/// @throws FileError  the bytes end too early, or the view has no camera, pose or depths
SavedView unpack_view(const std::uint8_t* bytes, std::size_t size, std::size_t* used);

}  // namespace frontier_surfels
