/// Khronos' C++ bindings of OpenCL, and its errors as sentences.
#pragma once

#include <CL/opencl.hpp>
#include <string>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Name of an OpenCL error code; "error -1234" for codes without a name in this function.
std::string opencl_error_name(cl_int code);

/// Error with a sentence that names the failed call and what to do.
DeviceError device_error(const cl::Error& error);

/// Throws device_error() for an OpenCL error and rethrows any other error. Call it from a catch block.
/// Takes the base class, so that callers do not depend on OpenCL.
[[noreturn]] void throw_device_error(const std::exception& error);

}  // namespace frontier_surfels
