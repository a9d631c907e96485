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

/// Kernels that are built together. There are several such programs, because drivers take seconds for all of them, and few mappers need
/// all.
struct KernelProgram {
  std::string name;                  ///< which kernels they are
  std::string source;                ///< the compiler's messages name the file and its line
  std::vector<std::string> kernels;  ///< names
};

/// @name Programs that are built when they are needed
/// @{
constexpr const char* kKnownSpaceProgram = "known space";  ///< for frames, where there are no seen points: KnownSpace
constexpr const char* kPlannersProgram = "planners";       ///< for questions
/// @}

/// All kernels. What every frame needs is in the first program.
const std::vector<KernelProgram>& kernel_programs();

/// Builds a program and makes all its kernels.
/// @param cache  folder of kept programs, see program_cache.hpp; "": programs are not kept
/// @throws DeviceError  the source does not build; cl::Error  the device fails
BuiltKernels build_kernels(const Device& device, const std::string& source, const std::string& options, const std::filesystem::path& cache);

/// All that a built program depends on, as text.
std::string program_identity(const cl::Device& device, const std::string& source, const std::string& options);

}  // namespace frontier_surfels
