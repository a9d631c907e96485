/// Building of the kernels, from their source or from a binary that an earlier process has kept.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "opencl/device.hpp"

namespace frontier_surfels {

struct BuiltKernels {
  std::vector<cl::Kernel> kernels;
  bool from_cache = false;
};

/// All kernel files as one source. The compiler's messages name the file and its line.
std::string kernel_source();

/// Builds a program and makes all its kernels.
/// @param cache  folder of kept programs, see program_cache.hpp; "": programs are not kept
/// @throws DeviceError  the source does not build; cl::Error  the device fails
BuiltKernels build_kernels(const Device& device, const std::string& source, const std::string& options, const std::filesystem::path& cache);

/// All that a built program depends on, as text.
std::string program_identity(const cl::Device& device, const std::string& source, const std::string& options);

}  // namespace frontier_surfels
