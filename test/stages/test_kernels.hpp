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
  /// @param source  OpenCL C that is compiled behind the library's kernels and kLanesOfElements
  explicit TestKernels(const std::string& source) : device_(test_commands().device()), queue_(device_.context, device_.device) {
    std::string text;
    for (const KernelFile& file : kernel_files()) text += "#line 1 \"" + file.name + "\"\n" + file.text + "\n";
    program_ = cl::Program(device_.context, text + kLanesOfElements + "#line 1 \"test\"\n" + source);
    try {
      program_.build({device_.device}, build_options(device_).c_str());
    } catch (const cl::Error&) {
      throw DeviceError(program_.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device_.device));
    }
  }

  /// Runs a kernel whose first argument is `out`, filled with zeros, and whose second one is `in`. @return `out_size` values of `out`
  template <typename Out, typename In, typename... Args>
  std::vector<Out> run(const char* kernel, std::size_t items, const std::vector<In>& in, std::size_t out_size, const Args&... args) {
    const cl::Buffer from(device_.context, CL_MEM_READ_WRITE, std::max<std::size_t>(in.size(), 1) * sizeof(In));
    const cl::Buffer to(device_.context, CL_MEM_READ_WRITE, out_size * sizeof(Out));
    queue_.enqueueFillBuffer(to, cl_uchar{0}, 0, out_size * sizeof(Out));
    if (!in.empty()) queue_.enqueueWriteBuffer(from, CL_TRUE, 0, in.size() * sizeof(In), in.data());
    const cl::Kernel function(program_, kernel);
    const std::size_t group = function.getWorkGroupInfo<CL_KERNEL_COMPILE_WORK_GROUP_SIZE>(device_.device)[0];  // 0: not given
    cl::KernelFunctor<cl::Buffer, cl::Buffer, Args...> functor(function);
    functor(cl::EnqueueArgs(queue_, cl::NDRange(items), group == 0 ? cl::NullRange : cl::NDRange(group)), to, from, args...);
    std::vector<Out> out(out_size);
    queue_.enqueueReadBuffer(to, CL_TRUE, 0, out_size * sizeof(Out), out.data());
    return out;
  }

  /// As run(), for a kernel whose work item n handles LANES elements of `in`, from element LANES n on.
  /// @param per_element  values of `out` for each element
  template <typename Out, typename In, typename... Args>
  std::vector<Out> run_lanes(const char* kernel, std::vector<In> in, std::size_t per_element, const Args&... args) {
    const std::size_t size = in.size(), lanes = test_commands().lanes(), items = test_commands().chunks(size);
    in.resize(items * lanes, in.back());
    std::vector<Out> out = run<Out>(kernel, items, in, per_element * in.size(), args...);
    out.resize(per_element * size);
    return out;
  }

 private:
  /// Functions that load or store LANES elements of a buffer of float4 or int4.
  static constexpr const char* kLanesOfElements = R"CL(
INLINE Points load_points(__global const float4* from) {
  const Quads q = load_quads((__global const uint4*)from);
  return (Points){as_floatv(q.x), as_floatv(q.y), as_floatv(q.z)};
}
INLINE void OVERLOADED store_elements(floatv x, floatv y, floatv z, floatv w, int first, __global float4* to) {
  const Quads q = {as_uintv(x), as_uintv(y), as_uintv(z), as_uintv(w)};
  scatter_quads(q, first + lane_numbers(), (intv)(-1), (__global uint4*)to);
}
INLINE void OVERLOADED store_elements(intv x, intv y, intv z, intv w, int first, __global int4* to) {
  const Quads q = {as_uintv(x), as_uintv(y), as_uintv(z), as_uintv(w)};
  scatter_quads(q, first + lane_numbers(), (intv)(-1), (__global uint4*)to);
}
)CL";

  Device device_;
  cl::CommandQueue queue_;
  cl::Program program_;
};

}  // namespace frontier_surfels
