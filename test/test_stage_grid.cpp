/// kernels/common/grid.cl: F, F^-1 and bit operations on the device, compared with double precision and loops over bits.

#include <gtest/gtest.h>

#include "frame/recent_views.hpp"
#include "frame/view_grid.hpp"
#include "stages/reference_grid.hpp"
#include "stages/test_kernels.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

const char* const kSource = R"CL(
__kernel void test_to_grid(__global float4* out, __global const float4* in, const Grid g) {
  const int n = get_global_id(0);
  out[n] = (float4)(to_grid(&g, in[n].xyz), voxel_size(&g, in[n].z));
}
__kernel void test_from_grid(__global float4* out, __global const float4* in, const Grid g) {
  const int n = get_global_id(0);
  out[n] = (float4)(from_grid(&g, in[n].xyz), 0.0f);
}
__kernel void test_voxel_of(__global int4* out, __global const float4* in, const Grid g) {
  const int n = get_global_id(0);
  const int3 v = voxel_of(in[n].xyz);
  out[n] = (int4)(v, inside_grid(&g, v) ? 1 : 0);
}
__kernel void test_natural_log(__global float* out, __global const float* in) {
  const int n = get_global_id(0), of_16 = get_global_size(0);
  const float16 x = vload16(n, in);
  vstore16(natural_log16(x), n, out);
  for (int lane = 0; lane < 16; ++lane) out[16 * of_16 + 16 * n + lane] = natural_log(in[16 * n + lane]);
}
__kernel void test_floor(__global int* out, __global const float* in) {
  const int n = get_global_id(0), of_16 = get_global_size(0);
  vstore16(floor_int16(vload16(n, in)), n, out);
  for (int lane = 0; lane < 16; ++lane) {
    out[16 * of_16 + 16 * n + lane] = floor_int(in[16 * n + lane]);
    out[32 * of_16 + 16 * n + lane] = ceil_int(in[16 * n + lane]);
  }
}
__kernel void test_transform(__global float4* out, __global const float4* in, const Transform T) {
  const int n = get_global_id(0);
  out[2 * n] = (float4)(transform_point(&T, in[n].xyz), 0.0f);
  out[2 * n + 1] = (float4)(rotate(&T, in[n].xyz), 0.0f);
}
__kernel void test_bit_run(__global ulong* out, __global const int2* in) {
  const int n = get_global_id(0);
  out[n] = bit_run(in[n].x, in[n].y);
}
__kernel void test_bits(__global int2* out, __global const ulong* in) {
  const int n = get_global_id(0);
  out[n] = (int2)(lowest_bit(in[n]), highest_bit(in[n]));
}
__kernel void test_field(__global int* out, __global const ulong* in, const Grid g) {
  const int n = get_global_id(0);
  const int3 v = (int3)(n / g.size_k / g.size_j, n / g.size_k % g.size_j, n % g.size_k);
  out[n] = test_bit(&g, in, v) ? 1 : 0;
}
__kernel void test_valid_layers(__global ulong* out, __global const int* in, const Grid g) {
  out[get_global_id(0)] = valid_layers(&g, in[get_global_id(0)]);
}
)CL";

TestKernels& kernels() {
  static auto* const kernels = new TestKernels(kSource);
  return *kernels;
}

cl_float4 pack4(const Vector3d& v) { return {{static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()), 0}}; }
Vector3d unpack4(const cl_float4& v) { return {v.s[0], v.s[1], v.s[2]}; }

/// Cameras, most of which have different fx and fy.
std::vector<CameraSetup> grids() {
  std::vector<CameraSetup> all = cameras();
  all.push_back(make_camera(160, 120, 131.25, 131.25, 369));
  all.push_back(make_camera(20, 20, 10, 50, 60));
  return all;
}

std::vector<cl_float4> random_points(const Nuvg& grid, int count, Random& random) {
  std::vector<cl_float4> points;
  for (int n = 0; n < count; ++n) {
    const Vector3d c(random.uniform(-20, grid.size_i + 20), random.uniform(-20, grid.size_j + 20), random.uniform(-20, grid.size_k + 20));
    points.push_back(pack4(grid.from_grid(c)));
  }
  return points;
}

TEST(StageGrid, F) {
  for (const CameraSetup& camera : grids()) {
    SCOPED_TRACE(camera.name);
    Random random(1);
    const Nuvg grid(camera.intrinsics, camera.config);
    const Grid device_grid = make_view_grid(camera.intrinsics, camera.config).grid;
    const std::vector<cl_float4> points = random_points(grid, 200, random);
    const auto c = kernels().run<cl_float4>("test_to_grid", points.size(), points, points.size(), device_grid);
    for (std::size_t n = 0; n < points.size(); ++n) {
      const Vector3d p = unpack4(points[n]);
      EXPECT_LT((unpack4(c[n]) - grid.to_grid(p)).norm(), 1e-3) << p.transpose();
      EXPECT_NEAR(c[n].s[3], grid.voxel_size(p.z()), 1e-6);
    }
  }
}

TEST(StageGrid, InverseOfF) {
  for (const CameraSetup& camera : grids()) {
    SCOPED_TRACE(camera.name);
    Random random(2);
    const Nuvg grid(camera.intrinsics, camera.config);
    const Grid device_grid = make_view_grid(camera.intrinsics, camera.config).grid;
    const std::vector<cl_float4> points = random_points(grid, 200, random);
    const auto c = kernels().run<cl_float4>("test_to_grid", points.size(), points, points.size(), device_grid);
    const auto back = kernels().run<cl_float4>("test_from_grid", c.size(), c, c.size(), device_grid);
    for (std::size_t n = 0; n < points.size(); ++n) {
      const Vector3d p = unpack4(points[n]);
      EXPECT_LT((unpack4(back[n]) - p).norm(), 1e-3 * grid.voxel_size(p.z())) << p.transpose();
    }
  }
}

TEST(StageGrid, ContinuousAtZMin) {
  for (const CameraSetup& camera : grids()) {
    SCOPED_TRACE(camera.name);
    const Grid g = make_view_grid(camera.intrinsics, camera.config).grid;
    std::vector<cl_float4> points;
    for (const double x : {-0.3, 0.0, 0.2})
      for (const float z : {std::nextafter(g.z_min, 0.0F), g.z_min, std::nextafter(g.z_min, 1.0F)})
        points.push_back({{float(x), 0.1F, z, 0}});
    const auto c = kernels().run<cl_float4>("test_to_grid", points.size(), points, points.size(), g);
    for (std::size_t n = 0; n < points.size(); ++n) EXPECT_NEAR(c[n].s[2], g.k_min, 1e-4);
    for (std::size_t n = 0; n < points.size(); n += 3) EXPECT_LT((unpack4(c[n]) - unpack4(c[n + 2])).norm(), 1e-3);
  }
}

TEST(StageGrid, Voxels) {
  for (const CameraSetup& camera : grids()) {
    SCOPED_TRACE(camera.name);
    Random random(3);
    const Nuvg grid(camera.intrinsics, camera.config);
    std::vector<cl_float4> c;
    for (int n = 0; n < 300; ++n) {
      const auto near_border = [&](int size) { return random.chance(0.5) ? random.uniform(-2, 2) : size + random.uniform(-2, 2); };
      c.push_back(pack4({near_border(grid.size_i), near_border(grid.size_j), near_border(grid.size_k)}));
    }
    const auto v = kernels().run<cl_int4>("test_voxel_of", c.size(), c, c.size(), make_view_grid(camera.intrinsics, camera.config).grid);
    for (std::size_t n = 0; n < c.size(); ++n) {
      const Voxel expected = voxel_of(unpack4(c[n]), 1e-4);
      if (expected.open) continue;
      EXPECT_EQ(Vector3i(v[n].s[0], v[n].s[1], v[n].s[2]), expected.index);
      EXPECT_EQ(v[n].s[3] != 0, grid.contains(expected.index));
    }
  }
}

TEST(StageGrid, NaturalLogarithm) {
  Random random(7);
  std::vector<float> x = {1, std::nextafter(1.0F, 0.0F), std::nextafter(1.0F, 2.0F), 1e-6F, 1e6F};
  for (int exponent = -19; exponent < 20; ++exponent)  // where m jumps from sqrt 2 to 1 / sqrt 2, and powers of two
    for (const double m : {1.0, std::sqrt(2.0)})
      for (const float to : {0.0F, 1e9F}) {
        x.push_back(static_cast<float>(std::ldexp(m, exponent)));
        x.push_back(std::nextafter(x.back(), to));
      }
  while (x.size() < 40000 || x.size() % 16 != 0)
    x.push_back(
        static_cast<float>(random.chance(0.2) ? random.uniform(0.9, 1.1) : std::exp(random.uniform(std::log(1e-6), std::log(1e6)))));
  const auto out = kernels().run<float>("test_natural_log", x.size() / 16, x, 2 * x.size());
  double worst = 0;
  for (std::size_t n = 0; n < x.size(); ++n) {
    const double expected = std::log(static_cast<double>(x[n]));
    worst = std::max(worst, std::abs(out[n] - expected) / std::max(1.0, std::abs(expected)));
    ASSERT_EQ(out[x.size() + n], out[n]) << "one at a time, of " << x[n];
  }
  EXPECT_LT(worst, 2e-7);
}

TEST(StageGrid, Rounding) {
  Random random(8);
  std::vector<float> x;
  for (int whole = -9; whole <= 9; ++whole)
    for (const float at : {static_cast<float>(whole), std::nextafter(static_cast<float>(whole), -1e9F),
                           std::nextafter(static_cast<float>(whole), 1e9F), static_cast<float>(whole) + 0.5F})
      x.push_back(at);
  while (x.size() < 1600 || x.size() % 16 != 0) x.push_back(static_cast<float>(random.uniform(-3000, 3000)));
  const auto out = kernels().run<cl_int>("test_floor", x.size() / 16, x, 3 * x.size());
  for (std::size_t n = 0; n < x.size(); ++n) {
    EXPECT_EQ(out[n], std::floor(x[n])) << "sixteen at a time, of " << x[n];
    EXPECT_EQ(out[x.size() + n], std::floor(x[n])) << x[n];
    EXPECT_EQ(out[2 * x.size() + n], std::ceil(x[n])) << x[n];
  }
}

TEST(StageGrid, Transforms) {
  Random random(4);
  const Eigen::Isometry3d T = random.pose(3, 3);
  std::vector<cl_float4> points;
  for (int n = 0; n < 20; ++n) points.push_back(pack4(random.direction()));
  const auto out = kernels().run<cl_float4>("test_transform", points.size(), points, 2 * points.size(), to_transform(T));
  for (std::size_t n = 0; n < points.size(); ++n) {
    EXPECT_LT((unpack4(out[2 * n]) - T * unpack4(points[n])).norm(), 1e-5);
    EXPECT_LT((unpack4(out[2 * n + 1]) - T.linear() * unpack4(points[n])).norm(), 1e-5);
  }
}

TEST(StageGrid, BitRuns) {
  std::vector<cl_int2> runs;
  for (int from = -70; from <= 140; from += 1)
    for (const int to : {-100, -1, 0, 1, 2, 31, 32, 33, 63, 64, 65, 100, 200}) runs.push_back({{from, to}});
  const auto out = kernels().run<cl_ulong>("test_bit_run", runs.size(), runs, runs.size());
  for (std::size_t n = 0; n < runs.size(); ++n) {
    std::uint64_t expected = 0;
    for (int bit = 0; bit < 64; ++bit)
      if (bit >= runs[n].s[0] && bit < runs[n].s[1]) expected |= std::uint64_t{1} << bit;
    EXPECT_EQ(out[n], expected) << runs[n].s[0] << " to " << runs[n].s[1];
  }
}

TEST(StageGrid, LowestAndHighestBit) {
  Random random(5);
  std::vector<cl_ulong> words;
  for (int low = 0; low < 64; ++low)
    for (int high = low; high < 64; ++high) {
      cl_ulong word = std::uint64_t{1} << low | std::uint64_t{1} << high;
      for (int bit = low + 1; bit < high; ++bit) word |= static_cast<cl_ulong>(random.chance(0.3)) << bit;
      words.push_back(word);
    }
  const auto out = kernels().run<cl_int2>("test_bits", words.size(), words, words.size());
  std::size_t n = 0;
  for (int low = 0; low < 64; ++low)
    for (int high = low; high < 64; ++high, ++n) {
      EXPECT_EQ(out[n].s[0], low);
      EXPECT_EQ(out[n].s[1], high);
    }
}

TEST(StageGrid, LayoutOfBitFields) {
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Random random(6);
    const Grid g = make_view_grid(camera.intrinsics, camera.config).grid;
    const Field<char> field = random_field(g, 0.3, random);
    const auto bits = kernels().run<cl_int>("test_field", field.values.size(), pack(field), field.values.size(), g);
    std::size_t wrong = 0;
    for (std::size_t n = 0; n < bits.size(); ++n) wrong += bits[n] != field.values[n];
    EXPECT_EQ(wrong, 0u);

    std::vector<cl_int> words(g.words_k);
    for (int w = 0; w < g.words_k; ++w) words[w] = w;
    const auto layers = kernels().run<cl_ulong>("test_valid_layers", words.size(), words, words.size(), g);
    for (int k = 0; k < 64 * g.words_k; ++k) EXPECT_EQ(layers[k / 64] >> (k % 64) & 1, k < g.size_k ? 1u : 0u) << "layer " << k;
  }
}

}  // namespace
}  // namespace frontier_surfels
