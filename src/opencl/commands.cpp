#include "opencl/commands.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <mutex>

#include "opencl/program_cache.hpp"
#include "opencl/programs.hpp"
#include "opencl/rounding.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kHugePage = 2 << 20;  // [byte], on most processors

/// A buffer in host memory, where a CPU works in place. Large pages make its memory accesses faster.
cl::Buffer allocate_on_host(const cl::Context& context, std::size_t bytes) {
  const std::size_t whole = (bytes + kHugePage - 1) / kHugePage * kHugePage;
  std::unique_ptr<void, decltype(&std::free)> memory(std::aligned_alloc(kHugePage, whole), &std::free);
  if (memory == nullptr) throw cl::Error(CL_MEM_OBJECT_ALLOCATION_FAILURE, "aligned_alloc");
  madvise(memory.get(), whole, MADV_HUGEPAGE);  // only advice: it may fail
  cl::Buffer buffer(context, CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, bytes, memory.get());
  buffer.setDestructorCallback([](cl_mem, void* own) { std::free(own); }, memory.get());
  memory.release();
  return buffer;
}

/// Keeps a queue, which is small, for as long as the process lives: PoCL's threads may still use it to release the last command after
/// finish() has returned.
void retire(const cl::CommandQueue& queue, const Device& device) {
  static std::mutex mutex;
  static auto* const retired = new std::vector<std::pair<cl::CommandQueue, Device>>;  // not destroyed: drivers may be unloaded earlier
  const std::lock_guard<std::mutex> lock(mutex);
  retired->emplace_back(queue, device);
}

}  // namespace

/// Warnings are errors on CPUs with PoCL, with which the kernels are developed. Other compilers may warn of something else, and must still
/// build them.
std::string build_options(const Device& device) {
  return std::string("-cl-std=CL1.2") + (device.is_pocl && device.is_cpu ? " -Werror" : "") + rounding_option(device) +
         " -DLANES=" + std::to_string(device.lanes) + (device.is_cpu ? " -DON_CPU" : "") +
         " -DHEAVY_GROUP=" + std::to_string(shape_for(device).heavy_group) +
         " -DTILE_GROUP=" + std::to_string(shape_for(device).tile_group) + " -DVIEW_TEAM=" + std::to_string(shape_for(device).view_team);
}

Commands::Commands(Device device) : device_(std::move(device)) {
  try {
    shape_ = shape_for(device_);
    times_stages_ = device_.is_cpu;
    timed_queue_ = cl::CommandQueue(device_.context, device_.device, CL_QUEUE_PROFILING_ENABLE);
    plain_queue_ = cl::CommandQueue(device_.context, device_.device);
    max_buffer_bytes_ = device_.device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
    device_bytes_ = device_.device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
    build(kernel_programs().front());
  } catch (const cl::Error& error) {
    throw device_error(error);
  }
}

Commands::~Commands() {
  try {
    wait();  // commands of a failed frame may still read the kept values
  } catch (const cl::Error&) {
    // The device is lost, so no command reads them any more.
  }
  retire(timed_queue_, device_);
  retire(plain_queue_, device_);
}

void Commands::build(const KernelProgram& program) {
  const auto cache = !device_.is_pocl ? program_cache_folder() : std::filesystem::path();
  for (const auto& kernel : build_kernels(device_, program.source, build_options(device_), cache).kernels)
    kernels_[kernel.getInfo<CL_KERNEL_FUNCTION_NAME>()] = kernel;
  programs_.insert(program.name);
}

void Commands::build(const std::string& name) {
  for (const KernelProgram& program : kernel_programs())
    if (program.name == name && !has_built(name)) build(program);
}

cl::Kernel& Commands::kernel(const std::string& name) {
  const auto found = kernels_.find(name);
  if (found != kernels_.end()) return found->second;
  for (const KernelProgram& program : kernel_programs())
    if (std::find(program.kernels.begin(), program.kernels.end(), name) != program.kernels.end()) build(program);
  return kernels_.at(name);
}

void Commands::wait() {
  if (!pending_) return;
  enqueue_reads();
  FaultInjection::step(Call::kWait, "clFinish");
  queue_now().finish();
  waited();
}

void Commands::time_stages(bool timed) {
  if (timed == times_stages_) return;
  wait();  // the queues do not wait for each other
  times_stages_ = timed;
}

std::vector<StageTime> Commands::take_times() {
  wait();
  std::vector<StageTime> times;
  for (const auto& [stage, event] : events_) {
    auto found = std::find_if(times.begin(), times.end(), [&name = stage](const StageTime& time) { return time.name == name; });
    if (found == times.end()) found = times.insert(times.end(), StageTime{stage, 0});
    found->ms += 1e-6 * (event.getProfilingInfo<CL_PROFILING_COMMAND_END>() - event.getProfilingInfo<CL_PROFILING_COMMAND_START>());
  }
  events_.clear();
  return times;
}

cl::Buffer Commands::allocate(std::size_t bytes) {
  if (bytes > max_buffer_bytes_)
    throw DeviceError("A buffer of " + mebibytes(bytes) + " is needed and the device allows " + mebibytes(max_buffer_bytes_) + " (" +
                      memory_text() + "); " + kLowerMemory);
  try {
    FaultInjection::step(Call::kAllocation, "clCreateBuffer", CL_MEM_OBJECT_ALLOCATION_FAILURE);
    if (device_.is_cpu && bytes >= kHugePage / 2) return allocate_on_host(device_.context, bytes);
    cl::Buffer buffer(device_.context, CL_MEM_READ_WRITE, bytes);
    if (!device_.shares_memory) claim(buffer);
    return buffer;
  } catch (const cl::Error& error) {
    throw AllocationError(error, bytes);
  }
}

/// Drivers may put off to a buffer's first use what fails if there is too little memory. It is to fail here, where the buffer has not
/// replaced a smaller one yet.
void Commands::claim(const cl::Buffer& buffer) { queue(Call::kFill).enqueueFillBuffer(buffer, cl_uchar{0}, 0, 1); }

std::string Commands::memory_text() const {
  return "this mapper uses " + mebibytes(allocated_bytes_) + " of the device's " + mebibytes(device_bytes_);
}

}  // namespace frontier_surfels
