/// Test kernels that call functions of the library's kernel files.
#pragma once

#include <string>
#include <vector>

#include "opencl/kernel_files.hpp"
#include "random_input.hpp"
#include "test_device.hpp"

namespace frontier_surfels {

class TestKernels {
 public:
  /// @param source  OpenCL C that follows the library's own
  explicit TestKernels(const std::string& source) : device_(test_commands().device()), queue_(device_.context, device_.device) {
    std::string text;
    for (const KernelFile& file : kernel_files()) text += "#line 1 \"" + file.name + "\"\n" + file.text + "\n";
    program_ = cl::Program(device_.context, text + "#line 1 \"test\"\n" + source);
    try {
      program_.build({device_.device}, "-cl-std=CL1.2");
    } catch (const cl::Error&) {
      throw DeviceError(program_.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device_.device));
    }
  }

  /// Runs a kernel whose first argument is `out` and whose second one is `in`. @return `out_size` values of `out`
  template <typename Out, typename In, typename... Args>
  std::vector<Out> run(const char* kernel, std::size_t items, const std::vector<In>& in, std::size_t out_size, const Args&... args) {
    const cl::Buffer from(device_.context, CL_MEM_READ_WRITE, std::max<std::size_t>(in.size(), 1) * sizeof(In));
    const cl::Buffer to(device_.context, CL_MEM_READ_WRITE, out_size * sizeof(Out));
    if (!in.empty()) queue_.enqueueWriteBuffer(from, CL_TRUE, 0, in.size() * sizeof(In), in.data());
    cl::KernelFunctor<cl::Buffer, cl::Buffer, Args...> functor(cl::Kernel(program_, kernel));
    functor(cl::EnqueueArgs(queue_, cl::NDRange(items)), to, from, args...);
    std::vector<Out> out(out_size);
    queue_.enqueueReadBuffer(to, CL_TRUE, 0, out_size * sizeof(Out), out.data());
    return out;
  }

 private:
  Device device_;
  cl::CommandQueue queue_;
  cl::Program program_;
};

}  // namespace frontier_surfels
