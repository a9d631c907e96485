/// What kernels/common/arithmetic.cl promises, and the check of it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "stages/arithmetic_check.hpp"
#include "stages/random_input.hpp"
#include "stages/test_kernels.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kOfOne = 256;  // results of an operation

std::vector<cl_float> results() { return right_results(arithmetic_input()); }

using Names = std::vector<std::string>;

TEST(ArithmeticCheck, TheDeviceComputesAsItMust) { EXPECT_EQ(arithmetic_fault(test_commands()), ""); }

TEST(ArithmeticCheck, FindsContraction) {
  const ArithmeticInput input = arithmetic_input();
  std::vector<cl_float> contracted = results();
  std::size_t different = 0;
  for (std::size_t n = 0; n < kOfOne; ++n) {
    const float once = std::fma(input.a[n], input.b[n], input.c[n]);
    different += once != contracted[n];
    contracted[n] = once;
  }
  EXPECT_GT(different, kOfOne / 8);
  EXPECT_EQ(wrong_operations(results(), contracted), Names{"a * b + c"});
}

TEST(ArithmeticCheck, FindsQuotientsByAReciprocal) {
  const ArithmeticInput input = arithmetic_input();
  std::vector<cl_float> rough = results();
  for (std::size_t n = 0; n < kOfOne; ++n) rough[3 * kOfOne + n] = input.a[n] * (1.0F / input.b[n]);
  EXPECT_EQ(wrong_operations(results(), rough), Names{"division"});
}

TEST(ArithmeticCheck, FindsASingleWrongBitOrNaN) {
  for (const std::size_t at : {4 * kOfOne, 5 * kOfOne + 255, 7 * kOfOne + 31}) {
    std::vector<cl_float> other = results();
    other[at] = std::nextafter(other[at], 1e9F);
    EXPECT_EQ(wrong_operations(results(), other).size(), 1u);
    other[at] = std::nanf("");
    EXPECT_EQ(wrong_operations(results(), other).size(), 1u);
  }
}

TEST(ArithmeticCheck, TheSentenceNamesDeviceAndOperations) {
  EXPECT_EQ(arithmetic_sentence("card", {}), "");
  const std::string sentence = arithmetic_sentence("card", {"a * b + c", "division"});
  EXPECT_NE(sentence.find("The device card computes in a way of its own (a * b + c, division)"), std::string::npos) << sentence;
}

const char* const kNearest = R"CL(
// Quotients and roots from ones that are wrong by `off` units of the last place.
__kernel void nearest(__global float* out, __global const float4* in, const int off) {
  const int n = get_global_id(0);
  const Points p = load_points(in + LANES * n);
  vstorev(nearest_quotient(as_floatv(as_intv(p.x / p.y) + off), p.x, p.y), n, out);
  vstorev(nearest_root(as_floatv(as_intv(sqrt(p.z)) + off), p.z), get_global_size(0) + n, out);
}
)CL";

/// For devices that do not round quotients and roots correctly.
TEST(Arithmetic, OwnQuotientsAndRootsAreCorrectlyRounded) {
  TestKernels kernels(kNearest);
  reference::Random random(18);
  std::vector<cl_float4> points(1 << 14);
  for (cl_float4& p : points) {
    const float sign = random.chance(0.5) ? 1.0F : -1.0F;
    p = {{sign * static_cast<float>(random.uniform(1e-3, 1e3)), static_cast<float>(random.uniform(1e-2, 1e2)),
          static_cast<float>(random.uniform(1e-6, 10)), 0}};
    if (random.chance(0.1))
      p.s[2] = std::nextafter(std::ldexp(1.0F, 2 * (static_cast<int>(p.s[2]) % 4)), random.chance(0.5) ? 0.0F : 99.0F);
    if (random.chance(0.1)) p.s[1] = std::nextafter(1.0F, random.chance(0.5) ? 0.0F : 99.0F);
    if (random.chance(0.05)) p.s[0] = p.s[1] * static_cast<float>(static_cast<int>(p.s[0]));
  }
  points[0].s[2] = 0;
  const std::size_t items = test_commands().chunks(points.size());
  for (const cl_int off : {-3, -1, 0, 1, 3}) {
    const std::vector<float> out = kernels.run<float>("nearest", items, points, 2 * points.size(), off);
    for (std::size_t n = 0; n < points.size(); ++n) {
      const auto& [a, b, x, unused] = points[n].s;
      ASSERT_EQ(out[n], a / b) << a << " / " << b << ", off by " << off;
      if (x > 0) {
        ASSERT_EQ(out[points.size() + n], std::sqrt(x)) << x << ", off by " << off;
      }
    }
  }
}

}  // namespace
}  // namespace frontier_surfels
