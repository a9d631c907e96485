#include "opencl/opencl.hpp"

namespace frontier_surfels {

std::string mebibytes(std::size_t bytes) {
  const std::size_t tenths = (bytes * 10 + (std::size_t{1} << 20) - 1) >> 20;  // rounded up: what is small is not 0
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " MiB";
}

std::string opencl_error_name(cl_int code) {
  switch (code) {
    case CL_DEVICE_NOT_FOUND:
      return "CL_DEVICE_NOT_FOUND";
    case CL_DEVICE_NOT_AVAILABLE:
      return "CL_DEVICE_NOT_AVAILABLE";
    case CL_COMPILER_NOT_AVAILABLE:
      return "CL_COMPILER_NOT_AVAILABLE";
    case CL_MEM_OBJECT_ALLOCATION_FAILURE:
      return "CL_MEM_OBJECT_ALLOCATION_FAILURE";
    case CL_OUT_OF_RESOURCES:
      return "CL_OUT_OF_RESOURCES";
    case CL_OUT_OF_HOST_MEMORY:
      return "CL_OUT_OF_HOST_MEMORY";
    case CL_BUILD_PROGRAM_FAILURE:
      return "CL_BUILD_PROGRAM_FAILURE";
    case CL_INVALID_BUFFER_SIZE:
      return "CL_INVALID_BUFFER_SIZE";
    case CL_INVALID_WORK_GROUP_SIZE:
      return "CL_INVALID_WORK_GROUP_SIZE";
    case CL_INVALID_KERNEL_ARGS:
      return "CL_INVALID_KERNEL_ARGS";
    default:
      return "error " + std::to_string(code);
  }
}

DeviceError device_error(const cl::Error& error, const std::string& memory) {
  const std::string failed = std::string("The OpenCL call ") + error.what() + " failed with " + opencl_error_name(error.err());
  const bool is_memory = error.err() == CL_MEM_OBJECT_ALLOCATION_FAILURE || error.err() == CL_OUT_OF_RESOURCES ||
                         error.err() == CL_OUT_OF_HOST_MEMORY || error.err() == CL_INVALID_BUFFER_SIZE;
  if (!is_memory) return DeviceError(failed + "; choose another device or look at the driver's log.");
  std::string numbers;
  if (const auto* allocation = dynamic_cast<const AllocationError*>(&error))
    numbers = "a buffer of " + mebibytes(allocation->bytes) + " is needed";
  if (!memory.empty()) numbers += (numbers.empty() ? "" : ", ") + memory;
  return DeviceError(failed + ": the device has too little free memory" + (numbers.empty() ? "" : " (" + numbers + ")") + "; " +
                     kLowerMemory);
}

void throw_device_error(const std::exception& error, const std::string& memory) {
  if (const auto* opencl = dynamic_cast<const cl::Error*>(&error)) throw device_error(*opencl, memory);
  throw;
}

}  // namespace frontier_surfels
