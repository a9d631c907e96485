#include "opencl/device.hpp"

#include <algorithm>
#include <cctype>

#include "opencl/kernel_cache.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kPocl = "Portable Computing Language";  // name of its platform

struct Candidate {
  std::string platform;
  cl::Device device;
};

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

cl_device_type type_of(const std::string& name) {
  if (name == "cpu") return CL_DEVICE_TYPE_CPU;
  if (name == "gpu") return CL_DEVICE_TYPE_GPU;
  if (name == "accelerator") return CL_DEVICE_TYPE_ACCELERATOR;
  return CL_DEVICE_TYPE_ALL;
}

std::string type_name(cl_device_type type) {
  if (type & CL_DEVICE_TYPE_CPU) return "cpu";
  if (type & CL_DEVICE_TYPE_GPU) return "gpu";
  return "accelerator";
}

std::vector<Candidate> all_devices() {
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {  // thrown if there is no platform
  }
  std::vector<Candidate> found;
  for (const auto& platform : platforms) {
    std::vector<cl::Device> devices;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {  // thrown if the platform has no devices
    }
    for (const auto& device : devices) found.push_back({platform.getInfo<CL_PLATFORM_NAME>(), device});
  }
  return found;
}

std::string describe(const Candidate& candidate) {
  return candidate.platform + ": " + candidate.device.getInfo<CL_DEVICE_NAME>() + " (" +
         type_name(candidate.device.getInfo<CL_DEVICE_TYPE>()) + ", " +
         std::to_string(candidate.device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>()) + " compute units)";
}

std::string listing(const std::vector<Candidate>& candidates) {
  const bool has_pocl = std::any_of(candidates.begin(), candidates.end(), [](const Candidate& c) { return c.platform == kPocl; });
  const std::string fault = has_pocl ? "" : kernel_cache_fault(kernel_cache_folder());  // without the folder, PoCL has no devices
  if (candidates.empty())
    return " " + (fault.empty() ? "There is no OpenCL device at all: install a driver, or pocl-opencl-icd to use the CPU." : fault);
  std::string text = " Available devices:";
  for (const auto& candidate : candidates) text += "\n  " + describe(candidate);
  return fault.empty() ? text : text + "\n" + fault;
}

/// A part of the device with `threads` compute units; the whole device if `threads` is 0 or it has no more.
/// @throws DeviceError  the device cannot be divided
cl::Device limit_threads(const cl::Device& device, int threads) {
  if (threads == 0 || threads >= static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>())) return device;
  const cl_device_partition_property by_counts[] = {CL_DEVICE_PARTITION_BY_COUNTS, threads, CL_DEVICE_PARTITION_BY_COUNTS_LIST_END, 0};
  const auto cannot = [&](const std::string& why) {
    return DeviceError("The device " + device.getInfo<CL_DEVICE_NAME>() + " cannot be limited to " + std::to_string(threads) +
                       " compute units (" + why + "); set threads to 0.");
  };
  const auto ways = device.getInfo<CL_DEVICE_PARTITION_PROPERTIES>();
  if (std::find(ways.begin(), ways.end(), CL_DEVICE_PARTITION_BY_COUNTS) == ways.end()) throw cannot("it cannot be divided by counts");
  std::vector<cl::Device> parts;
  try {
    cl::Device whole = device;
    whole.createSubDevices(by_counts, &parts);
  } catch (const cl::Error& error) {
    throw cannot(opencl_error_name(error.err()));
  }
  return parts.front();
}

void check_abilities(const cl::Device& device) {
  const std::string name = device.getInfo<CL_DEVICE_NAME>();
  if (!device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>())
    throw DeviceError("The device " + name + " has no compiler for OpenCL C; choose another one.");
  if (!device.getInfo<CL_DEVICE_ENDIAN_LITTLE>())
    throw DeviceError("The device " + name + " is big endian, which the bit fields do not support; choose another one.");
  constexpr cl_ulong kLocalMemory = 32 * 1024;
  if (device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>() < kLocalMemory)
    throw DeviceError("The device " + name + " has less than 32 KiB of local memory; choose another one.");
}

}  // namespace

Device choose_device(const Config& config) {
  const std::vector<Candidate> candidates = all_devices();
  int fitting = 0;
  for (const auto& candidate : candidates) {
    if (lower(candidate.platform).find(lower(config.platform)) == std::string::npos) continue;
    if (!(candidate.device.getInfo<CL_DEVICE_TYPE>() & type_of(config.device_type))) continue;
    if (fitting++ != config.device_index) continue;
    try {
      if (candidate.platform == kPocl)
        if (const std::string fault = kernel_cache_fault(kernel_cache_folder()); !fault.empty()) throw DeviceError(fault);
      check_abilities(candidate.device);
      Device chosen;
      chosen.device = limit_threads(candidate.device, config.threads);
      chosen.context = cl::Context(chosen.device);
      chosen.shares_memory = chosen.device.getInfo<CL_DEVICE_HOST_UNIFIED_MEMORY>() != 0;
      chosen.is_cpu = chosen.device.getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_CPU;
      chosen.lanes = config.lanes != 0 ? config.lanes : chosen.is_cpu ? 16 : 1;
      chosen.prefers_one_item = chosen.is_cpu && candidate.platform == kPocl;
      chosen.description = describe({candidate.platform, chosen.device});
      return chosen;
    } catch (const cl::Error& error) {
      throw device_error(error);
    }
  }
  throw DeviceError("No OpenCL device fits platform '" + config.platform + "', device_type '" + config.device_type + "', device_index " +
                    std::to_string(config.device_index) + "." + listing(candidates));
}

}  // namespace frontier_surfels
