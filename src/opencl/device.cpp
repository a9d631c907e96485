#include "opencl/device.hpp"

#include <algorithm>
#include <vector>

#include "opencl/device_listing.hpp"
#include "opencl/device_ranking.hpp"
#include "opencl/kernel_cache.hpp"

namespace frontier_surfels {
namespace {

struct Found {
  std::vector<cl::Device> devices;
  std::vector<DeviceFacts> facts;  ///< of each device
};

std::string type_name(cl_device_type type) {
  if (type & CL_DEVICE_TYPE_GPU) return "gpu";
  if (type & CL_DEVICE_TYPE_CPU) return "cpu";
  return "accelerator";
}

DeviceFacts facts_of(const std::string& platform, const cl::Device& device) {
  DeviceFacts facts;
  facts.platform = platform;
  try {
    facts.name = driver_text(device.getInfo<CL_DEVICE_NAME>());
    facts.driver = driver_text(device.getInfo<CL_DRIVER_VERSION>());
    facts.version = driver_text(device.getInfo<CL_DEVICE_VERSION>());
    facts.type = type_name(device.getInfo<CL_DEVICE_TYPE>());
    facts.compute_units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
    facts.clock_mhz = device.getInfo<CL_DEVICE_MAX_CLOCK_FREQUENCY>();
    facts.global_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
    facts.largest_buffer_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
    facts.local_bytes = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
    facts.group_items = device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
    facts.available = device.getInfo<CL_DEVICE_AVAILABLE>();
    facts.has_compiler = device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>();
    facts.little_endian = device.getInfo<CL_DEVICE_ENDIAN_LITTLE>();
    if (platform == kPocl) facts.fault = kernel_cache_fault(kernel_cache_folder());
  } catch (const cl::Error& error) {
    facts.fault = "its driver answers with " + opencl_error_name(error.err());
  }
  return facts;
}

/// All devices, in the order of the platforms.
Found find_devices() {
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {  // thrown if there is no platform
  }
  Found found;
  for (const auto& platform : platforms) {
    std::vector<cl::Device> devices;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {  // thrown if the platform has no devices
    }
    for (const auto& device : devices) {
      found.devices.push_back(device);
      found.facts.push_back(facts_of(driver_text(platform.getInfo<CL_PLATFORM_NAME>()), device));
    }
  }
  return found;
}

/// Why PoCL shows no devices: its cache folder; "" if it has some, or the folder is sound.
std::string pocl_fault(const Found& found) {
  const bool has_pocl =
      std::any_of(found.facts.begin(), found.facts.end(), [](const DeviceFacts& facts) { return facts.platform == kPocl; });
  return has_pocl ? "" : kernel_cache_fault(kernel_cache_folder());
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

Choice choose_or_explain(const Found& found, const Config& config) {
  try {
    return choose(found.facts, config);
  } catch (const DeviceError& error) {
    const std::string fault = pocl_fault(found);
    throw DeviceError(error.what() + (fault.empty() ? "" : "\n" + fault));
  }
}

}  // namespace

Device choose_device(const Config& config) {
  const Found found = find_devices();
  const Choice choice = choose_or_explain(found, config);
  DeviceFacts facts = found.facts[choice.index];
  try {
    Device chosen;
    chosen.device = limit_threads(found.devices[choice.index], config.threads);
    chosen.context = cl::Context(chosen.device);
    chosen.shares_memory = chosen.device.getInfo<CL_DEVICE_HOST_UNIFIED_MEMORY>() != 0;
    chosen.is_cpu = facts.type == "cpu";
    chosen.is_pocl = facts.platform == kPocl;
    chosen.has_teams = !chosen.is_cpu;
    chosen.is_pocl_cpu = chosen.is_cpu && chosen.is_pocl;
    chosen.lanes = config.lanes != 0 ? config.lanes : chosen.is_pocl_cpu ? 16 : 1;
    facts.compute_units = chosen.device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
    chosen.description = describe(facts);
    chosen.choice = choice.why;
    return chosen;
  } catch (const cl::Error& error) {
    throw device_error(error);
  }
}

std::string device_listing() {
  const Found found = find_devices();
  const std::string fault = pocl_fault(found);
  return listing(found.facts, {}) + (fault.empty() ? "" : fault + "\n");
}

}  // namespace frontier_surfels
