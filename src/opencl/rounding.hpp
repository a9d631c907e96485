/// Whether a device rounds quotients and square roots correctly.
#pragma once

#include "opencl/device.hpp"

namespace frontier_surfels {

/// The build option by which kernels/common/arithmetic.cl gets correctly rounded quotients and roots on a device: OpenCL's own where the
/// device has it; nothing where it has not, but does so all the same for some thousand numbers, as llvmpipe; else the kernels' own
/// functions.
const char* rounding_option(const Device& device);

}  // namespace frontier_surfels
