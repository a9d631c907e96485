/// A surfel in 16 bytes, as kernels/common/surfels.cl packs it.
#pragma once

#include <vector>

#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"
#include "opencl/opencl.hpp"

namespace frontier_surfels {

/// Block of a position in the world [m].
BlockKey block_of(const Eigen::Vector3f& position, double block_size);

cl_uint4 pack(const Surfel& surfel, const BlockKey& block, double block_size);

Surfel unpack(const cl_uint4& packed, const BlockKey& block, double block_size);

/// The surfels of a block one after the other, 16 bytes each. @throws FileError  they are not whole
std::vector<Surfel> unpack_block(const std::vector<std::uint8_t>& bytes, const BlockKey& block, double block_size);
std::vector<cl_uint4> to_surfels(const std::vector<std::uint8_t>& bytes);

}  // namespace frontier_surfels
