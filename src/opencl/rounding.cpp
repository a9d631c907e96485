#include "opencl/rounding.hpp"

#include <cmath>
#include <vector>

#include "opencl/test_numbers.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kNumbers = 4096;
constexpr const char* kSource = R"CL(
__kernel void divide(__global const float* a, __global const float* b, __global float* quotients, __global float* roots) {
  const int n = get_global_id(0);
  quotients[n] = a[n] / b[n];
  roots[n] = sqrt(a[n]);
}
)CL";

/// Of those that are only nearly right, about one in four has another last bit.
bool divides_correctly(const Device& device) {
  std::vector<float> a, b, quotients(kNumbers), roots(kNumbers);
  TestNumbers numbers;
  for (std::size_t n = 0; n < kNumbers; ++n) {
    a.push_back(std::abs(numbers.any()));
    b.push_back(std::abs(numbers.any()));
  }
  cl::Program program(device.context, kSource);
  program.build({device.device}, "-cl-std=CL1.2");
  constexpr std::size_t kBytes = kNumbers * sizeof(float);
  const cl::Buffer from_a(device.context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, kBytes, a.data()),
      from_b(device.context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, kBytes, b.data()),
      to_quotients(device.context, CL_MEM_WRITE_ONLY, kBytes), to_roots(device.context, CL_MEM_WRITE_ONLY, kBytes);
  cl::CommandQueue queue(device.context, device.device);
  cl::KernelFunctor<cl::Buffer, cl::Buffer, cl::Buffer, cl::Buffer> divide(program, "divide");
  divide(cl::EnqueueArgs(queue, cl::NDRange(kNumbers)), from_a, from_b, to_quotients, to_roots);
  queue.enqueueReadBuffer(to_quotients, CL_TRUE, 0, kBytes, quotients.data());
  queue.enqueueReadBuffer(to_roots, CL_TRUE, 0, kBytes, roots.data());
  for (std::size_t n = 0; n < kNumbers; ++n)
    if (quotients[n] != a[n] / b[n] || roots[n] != std::sqrt(a[n])) return false;
  return true;
}

}  // namespace

const char* rounding_option(const Device& device) {
  if (device.device.getInfo<CL_DEVICE_SINGLE_FP_CONFIG>() & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT)
    return " -cl-fp32-correctly-rounded-divide-sqrt";
  return divides_correctly(device) ? "" : " -DOWN_DIVISION";
}

}  // namespace frontier_surfels
