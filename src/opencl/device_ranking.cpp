#include "opencl/device_ranking.hpp"

#include <algorithm>
#include <cctype>
#include <numeric>
#include <tuple>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

constexpr std::uint64_t kLocalBytes = 32 * 1024, kGroupItems = 64;  // that the kernels need

constexpr const char* kNothing = "There is no OpenCL device at all: install a driver, or pocl-opencl-icd to use the CPU.";

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

int type_rank(const DeviceFacts& device) { return device.type == "gpu" ? 0 : device.type == "accelerator" ? 1 : 2; }
bool is_other_cpu(const DeviceFacts& device) { return device.type == "cpu" && device.platform != kPocl; }
std::uint64_t speed(const DeviceFacts& device) { return std::uint64_t{device.compute_units} * device.clock_mhz; }

bool comes_before(const DeviceFacts& a, const DeviceFacts& b) {
  const auto order = [](const DeviceFacts& device) {
    return std::tuple(!lacking(device).empty(), type_rank(device), is_other_cpu(device));
  };
  return order(a) != order(b) ? order(a) < order(b) : speed(a) > speed(b);
}

bool fits(const DeviceFacts& device, const Config& config) {
  return lower(device.platform).find(lower(config.platform)) != std::string::npos &&
         (config.device_type == "any" || config.device_type == device.type);
}

/// What sets a device apart from the next one in the ranking.
std::string advantage(const DeviceFacts& device, const DeviceFacts& next) {
  if (type_rank(device) != type_rank(next)) return device.type == "gpu" ? "a graphics processor" : "an accelerator";
  if (is_other_cpu(device) != is_other_cpu(next)) return "PoCL, before other drivers of CPUs";
  return speed(device) > speed(next) ? "the most compute units x clock" : "the first of equals";
}

std::string whole_mebibytes(std::uint64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

/// @param fitting  those that fit, in ranking order
std::string reason(const std::vector<DeviceFacts>& devices, const std::vector<std::size_t>& fitting, const Config& config) {
  const auto is_usable = [&](std::size_t n) { return lacking(devices[n]).empty(); };
  const auto usable = static_cast<std::size_t>(std::count_if(fitting.begin(), fitting.end(), is_usable));
  const std::string narrowed = config.platform.empty() && config.device_type == "any" ? "" : " that fits platform and device_type";
  std::string why;
  if (config.device_index > 0)
    why = "device_index " + std::to_string(config.device_index) + " of the " + std::to_string(fitting.size()) + " from 0, fastest first";
  else if (usable == 1)
    why = "the only usable device" + narrowed;
  else
    why = "fastest usable" + narrowed + " of " + std::to_string(usable) + ": " + advantage(devices[fitting[0]], devices[fitting[1]]);
  for (const std::size_t n : fitting)
    if (!is_usable(n)) why += "; passed over: " + devices[n].name + ", because " + lacking(devices[n]);
  return why;
}

}  // namespace

std::string lacking(const DeviceFacts& device) {
  std::string text;
  const auto add = [&](bool lacks, const std::string& clause) {
    if (lacks) text += (text.empty() ? "" : ", and ") + clause;
  };
  add(!device.available, "it is not available");
  add(!device.has_compiler, "it has no compiler for OpenCL C");
  add(!device.little_endian, "it is big endian, which the bit fields do not support");
  add(device.local_bytes < kLocalBytes, "it has less than 32 KiB of local memory");
  add(device.group_items < kGroupItems, "it has no work-groups of 64 work items");
  add(!device.fault.empty(), device.fault);
  return text;
}

std::string describe(const DeviceFacts& device) {
  return device.platform + ": " + device.name + " (" + device.type + ", " + std::to_string(device.compute_units) + " compute units)";
}

std::vector<std::size_t> ranking(const std::vector<DeviceFacts>& devices) {
  std::vector<std::size_t> order(devices.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return comes_before(devices[a], devices[b]); });
  return order;
}

Choice choose(const std::vector<DeviceFacts>& devices, const Config& config) {
  const std::vector<std::size_t> order = ranking(devices);
  std::vector<std::size_t> fitting;
  std::copy_if(order.begin(), order.end(), std::back_inserter(fitting), [&](std::size_t n) { return fits(devices[n], config); });
  if (static_cast<std::size_t>(config.device_index) >= fitting.size()) {
    std::string text = "No OpenCL device fits platform '" + config.platform + "', device_type '" + config.device_type + "', device_index " +
                       std::to_string(config.device_index) + ".";
    if (devices.empty()) throw DeviceError(text + " " + kNothing);
    text += " Available devices:";
    for (const std::size_t n : order) text += "\n  " + describe(devices[n]);
    throw DeviceError(text);
  }
  const std::size_t chosen = fitting[config.device_index];
  if (const std::string lack = lacking(devices[chosen]); !lack.empty())
    throw DeviceError("The device " + devices[chosen].name + " cannot be used: " + lack + "; choose another one.");
  return {chosen, reason(devices, fitting, config)};
}

std::string listing(const std::vector<DeviceFacts>& devices, const Config& config) {
  if (devices.empty()) return std::string(kNothing) + "\n";
  std::string text = "OpenCL devices, fastest first:\n";
  for (const std::size_t n : ranking(devices)) {
    const DeviceFacts& device = devices[n];
    text += "\n" + device.platform + ": " + device.name + "\n";
    const auto line = [&](std::string name, const std::string& value) { text += "  " + name.append(16 - name.size(), ' ') + value + "\n"; };
    line("type", device.type);
    line("compute units", std::to_string(device.compute_units) + " at " + std::to_string(device.clock_mhz) + " MHz");
    line("global memory", whole_mebibytes(device.global_bytes));
    line("largest buffer", whole_mebibytes(device.largest_buffer_bytes));
    line("local memory", std::to_string(device.local_bytes >> 10) + " KiB");
    line("driver", device.driver);
    line("OpenCL", device.version);
    line("lacks", lacking(device).empty() ? "nothing" : lacking(device));
  }
  try {
    const Choice choice = choose(devices, config);
    return text + "\nThe default configuration takes " + describe(devices[choice.index]) + " (" + choice.why + ").\n";
  } catch (const DeviceError&) {
    return text + "\nThe default configuration takes none of them: install a driver, or pocl-opencl-icd to use the CPU.\n";
  }
}

}  // namespace frontier_surfels
