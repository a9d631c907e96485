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

/// Throws device_error() for an error of OpenCL's, and any other as it is. Call it while the error is being handled.
/// Takes the base class so that callers need not know of OpenCL.
[[noreturn]] void throw_device_error(const std::exception& error);

}  // namespace frontier_surfels
