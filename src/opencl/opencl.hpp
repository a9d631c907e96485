/// Khronos' C++ bindings of OpenCL, and its errors as sentences.
#pragma once

#include <CL/opencl.hpp>
#include <cstddef>
#include <string>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Name of an OpenCL error code; "error -1234" for codes without a name in this function.
std::string opencl_error_name(cl_int code);

/// A text that a driver gives, without the zero byte that some leave at its end.
inline std::string driver_text(const std::string& text) { return text.substr(0, text.find('\0')); }

/// An amount of memory for people, for instance "12.5 MiB".
std::string mebibytes(std::size_t bytes);

/// A buffer that could not be made.
struct AllocationError : cl::Error {
  AllocationError(const cl::Error& error, std::size_t needed) : cl::Error(error), bytes(needed) {}
  std::size_t bytes;
};

/// What to do where memory is too little, as the end of a sentence.
constexpr const char* kLowerMemory =
    "raise decimation, lower z_max or recent_views, set map_folder to keep far parts of the map on disk, or choose another device.";

/// Error with a sentence that names the failed call and what to do.
/// @param memory  what the mapper uses of the device's memory and how much there is, as a clause; "" if that is not known
DeviceError device_error(const cl::Error& error, const std::string& memory = "");

/// Throws device_error() for an OpenCL error and rethrows any other error. Call it from a catch block.
/// Takes the base class, so that callers do not depend on OpenCL.
[[noreturn]] void throw_device_error(const std::exception& error, const std::string& memory = "");

}  // namespace frontier_surfels
