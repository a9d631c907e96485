/// A surfel in 16 bytes, as kernels/1_surfels.cl packs it.
#pragma once

#include "block_key.hpp"
#include "frontier_surfels/types.hpp"
#include "opencl/opencl.hpp"

namespace frontier_surfels {

/// Block of a position in the world [m].
BlockKey block_of(const Eigen::Vector3f& position, double block_size);

cl_uint4 pack(const Surfel& surfel, const BlockKey& block, double block_size);

Surfel unpack(const cl_uint4& packed, const BlockKey& block, double block_size);

}  // namespace frontier_surfels
