#include "opencl/programs.hpp"

#include <algorithm>

#include "opencl/kernel_files.hpp"
#include "opencl/program_cache.hpp"

namespace frontier_surfels {
namespace {

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// The names of the kernels that a file defines.
std::vector<std::string> kernels_in(const KernelFile& file) {
  const std::string kernel = "\n__kernel ", type = "void ";
  std::vector<std::string> names;
  for (std::size_t at = file.text.find(kernel); at != std::string::npos; at = file.text.find(kernel, at + 1)) {
    const std::size_t name = file.text.find(type, at) + type.size();
    names.push_back(file.text.substr(name, file.text.find('(', name) - name));
  }
  return names;
}

/// The program that a file of kernels belongs to; "" for all. No function of one program is called in another.
std::string program_of(const std::string& file) {
  if (contains(file, "planner/")) return kPlannersProgram;
  for (const char* stage : {"needed_paths", "sign_field", "known_hull", "sweeps", "median"})
    if (contains(file, std::string("_") + stage + ".cl")) return kKnownSpaceProgram;
  return contains(file, "common/") && !contains(file, "/lists.cl") ? "" : "frames";
}

cl::Program build_source(const Device& device, const std::string& source, const std::string& options) {
  cl::Program program(device.context, source);
  try {
    program.build({device.device}, options.c_str());
  } catch (const cl::Error&) {
    const std::string log = program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device.device);
    if (log.empty()) throw;  // it is not the compiler that has failed
    throw DeviceError("The kernels do not build on " + device.description + " with " + options + ":\n" + log);
  }
  return program;
}

std::vector<cl::Kernel> kernels_of(cl::Program program) {
  std::vector<cl::Kernel> kernels;
  program.createKernels(&kernels);
  return kernels;
}

std::vector<std::string> names_of(const std::vector<cl::Kernel>& kernels) {
  std::vector<std::string> names;
  for (const cl::Kernel& kernel : kernels) names.push_back(kernel.getInfo<CL_KERNEL_FUNCTION_NAME>());
  std::sort(names.begin(), names.end());
  return names;
}

/// The kernels of a kept program; none if the driver does not take it, or if kernels are missing.
std::vector<cl::Kernel> kernels_of(const StoredProgram& stored, const Device& device, const std::string& options) {
  try {
    cl::Program program(device.context, {device.device}, {{stored.binary.begin(), stored.binary.end()}});
    program.build({device.device}, options.c_str());
    std::vector<cl::Kernel> kernels = kernels_of(program);
    if (names_of(kernels) == stored.kernels) return kernels;
  } catch (const cl::Error&) {  // the driver has changed without saying so, or the file is foreign
  }
  return {};
}

void keep(const cl::Program& program, const std::vector<cl::Kernel>& kernels, const std::filesystem::path& cache,
          const std::string& identity) {
  try {
    const auto binaries = program.getInfo<CL_PROGRAM_BINARIES>();
    if (binaries.size() == 1 && !binaries[0].empty())
      write_program(cache, identity, {names_of(kernels), {binaries[0].begin(), binaries[0].end()}});
  } catch (const cl::Error&) {  // a driver without binaries
  }
}

}  // namespace

const std::vector<KernelProgram>& kernel_programs() {
  static const std::vector<KernelProgram> programs = [] {
    std::vector<KernelProgram> all = {{"frames", "", {}}, {kKnownSpaceProgram, "", {}}, {kPlannersProgram, "", {}}};
    for (const KernelFile& file : kernel_files()) {
      const std::vector<std::string> kernels = kernels_in(file);
      const std::string own = program_of(file.name);
      for (KernelProgram& program : all) {
        if (!own.empty() && program.name != own) continue;
        program.source += "#line 1 \"" + file.name + "\"\n" + file.text + "\n";
        program.kernels.insert(program.kernels.end(), kernels.begin(), kernels.end());
      }
    }
    return all;
  }();
  return programs;
}

std::string program_identity(const cl::Device& device, const std::string& source, const std::string& options) {
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  std::string text;
  for (const std::string& part :
       {platform.getInfo<CL_PLATFORM_NAME>(), platform.getInfo<CL_PLATFORM_VERSION>(), device.getInfo<CL_DEVICE_NAME>(),
        device.getInfo<CL_DEVICE_VENDOR>(), device.getInfo<CL_DEVICE_VERSION>(), device.getInfo<CL_DRIVER_VERSION>(), options, source})
    text += driver_text(part) + "\n";
  return text;
}

BuiltKernels build_kernels(const Device& device, const std::string& source, const std::string& options,
                           const std::filesystem::path& cache) {
  if (cache.empty()) return {kernels_of(build_source(device, source, options)), false};
  const std::string identity = program_identity(device.device, source, options);
  if (const auto stored = read_program(cache, identity))
    if (std::vector<cl::Kernel> kernels = kernels_of(*stored, device, options); !kernels.empty()) return {kernels, true};
  const cl::Program program = build_source(device, source, options);
  const std::vector<cl::Kernel> kernels = kernels_of(program);
  keep(program, kernels, cache, identity);
  return {kernels, false};
}

}  // namespace frontier_surfels
