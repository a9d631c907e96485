/// Packs a surfel into 16 bytes, in the format of kernels/common/surfels.cl.
#pragma once

#include <vector>

#include "common/shared.h"
#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"
#include "opencl/opencl.hpp"

namespace frontier_surfels {

/// Block that contains a position. @param position  world frame [m];  block_size  [m]
BlockKey block_of(const Eigen::Vector3f& position, double block_size);

cl_uint4 pack(const Surfel& surfel, const BlockKey& block, double block_size);

Surfel unpack(const cl_uint4& packed, const BlockKey& block, double block_size);

/// Some pages of the map. A surfel of them is named by its entry: PAGE_SLOTS times the place of its page in `pages`, + its slot
/// there.
struct ListedPages {
  std::vector<std::uint32_t> pages;
  std::vector<cl_ulong> alive;  ///< of each page: its word
  std::vector<cl_int4> blocks;  ///< of each page: its block, and the frame that has changed it last

  cl_uint slot(cl_uint entry) const { return PAGE_SLOTS * pages[entry / PAGE_SLOTS] + entry % PAGE_SLOTS; }
};

/// Append the surfels of entries, with their ids. @param packed  one for each entry;  surfels: those of all slots of the map
void unpack_gathered(const std::vector<cl_uint4>& packed, const ListedPages& pages, const cl_uint* entries, double block_size,
                     std::vector<Surfel>& to);
void unpack_entries(const cl_uint4* surfels, const ListedPages& pages, const std::vector<cl_uint>& entries, double block_size,
                    std::vector<Surfel>& to);

/// Surfels of a block from bytes, 16 for each. @throws FileError  the number of bytes is no multiple of 16
std::vector<Surfel> unpack_block(const std::vector<std::uint8_t>& bytes, const BlockKey& block, double block_size);
std::vector<cl_uint4> to_surfels(const std::vector<std::uint8_t>& bytes);

}  // namespace frontier_surfels
