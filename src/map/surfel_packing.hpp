/// Packs a surfel into 16 bytes, in the format of kernels/common/surfels.cl.
#pragma once

#include <vector>

#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"
#include "opencl/opencl.hpp"

namespace frontier_surfels {

/// Block that contains a position. @param position  world frame [m];  block_size  [m]
BlockKey block_of(const Eigen::Vector3f& position, double block_size);

cl_uint4 pack(const Surfel& surfel, const BlockKey& block, double block_size);

Surfel unpack(const cl_uint4& packed, const BlockKey& block, double block_size);

/// Append the surfels of slots, with their ids. @param packed  one for each slot. @param surfels  of all slots of the map.
/// @param page_block  (x, y, z) of the blocks of all pages
void unpack_gathered(const std::vector<cl_uint4>& packed, const std::vector<cl_uint>& slots, const std::vector<cl_int4>& page_block,
                     double block_size, std::vector<Surfel>& to);
void unpack_slots(const cl_uint4* surfels, const std::vector<cl_uint>& slots, const std::vector<cl_int4>& page_block, double block_size,
                  std::vector<Surfel>& to);

/// Surfels of a block from bytes, 16 for each. @throws FileError  the number of bytes is no multiple of 16
std::vector<Surfel> unpack_block(const std::vector<std::uint8_t>& bytes, const BlockKey& block, double block_size);
std::vector<cl_uint4> to_surfels(const std::vector<std::uint8_t>& bytes);

}  // namespace frontier_surfels
