/// Khronos' C++ bindings as this library uses them, and errors as sentences.
#pragma once

#include <CL/opencl.hpp>
#include <string>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Name of an OpenCL error code, "error -1234" for one that has none here.
std::string opencl_error_name(cl_int code);

/// The sentence for a failed call.
DeviceError device_error(const cl::Error& error);

}  // namespace frontier_surfels
