/// kernels/common/grid.cl and the numbers of lanes.cl: F, F^-1, rounding, and the layout of bit fields, compared with double precision and
/// loops over bits.

#include <gtest/gtest.h>

#include <limits>

#include "frame/recent_views.hpp"
#include "frame/view_grid.hpp"
#include "stages/reference_grid.hpp"
#include "stages/test_kernels.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

const char* const kSource = R"CL(
__kernel void test_to_grid(__global float4* out, __global const float4* in, const Grid g) {
  const int first = LANES * get_global_id(0);
  const Points p = load_points(in + first), c = to_grid(&g, p);
  store_elements(c.x, c.y, c.z, voxel_size(&g, p.z), first, out);
}
__kernel void test_voxels_at(__global int4* out, __global const float4* in, const Grid g) {
  const int first = LANES * get_global_id(0);
  const Voxels v = voxels_at(&g, load_points(in + first));
  store_elements(v.i, v.j, v.k, inside_grid(&g, v), first, out);
}
__kernel void test_voxel_centers(__global float4* out, __global const int4* in, const Grid g, __global const float* layer_depth) {
  const int first = LANES * get_global_id(0);
  const Quads v = load_quads((__global const uint4*)(in + first));
  const Points p = voxel_centers(&g, layer_depth, (Voxels){as_intv(v.x), as_intv(v.y), as_intv(v.z)});
  store_elements(p.x, p.y, p.z, 0.0f, first, out);
}
__kernel void test_natural_log(__global float* out, __global const float* in) {
  vstorev(natural_log(vloadv(get_global_id(0), in)), get_global_id(0), out);
}
__kernel void test_rounding(__global int4* out, __global const float* in) {
  const int first = LANES * get_global_id(0);
  const floatv x = vloadv(get_global_id(0), in);
  int low[LANES], high[LANES];
  for (int lane = 0; lane < LANES; ++lane) {
    low[lane] = floor_int(in[first + lane]);
    high[lane] = ceil_int(in[first + lane]);
  }
  store_elements(floor_int(x), ceil_int(x), vloadv(0, low), vloadv(0, high), first, out);
}
__kernel void test_quotients(__global int* out, __global const int* in, const int divisor) {
  vstorev(quotients(vloadv(get_global_id(0), in), divisor), get_global_id(0), out);
}
__kernel void test_transformed(__global float4* out, __global const float4* in, const Transform T) {
  const int first = LANES * get_global_id(0);
  const Points p = transformed(&T, load_points(in + first));
  store_elements(p.x, p.y, p.z, 0.0f, first, out);
}
__kernel void test_rotated(__global float4* out, __global const float4* in, const Transform T) {
  const int first = LANES * get_global_id(0);
  const Points p = rotated(&T, load_points(in + first));
  store_elements(p.x, p.y, p.z, 0.0f, first, out);
}
__kernel void test_bit_run(__global ulong* out, __global const int2* in) {
  const int n = get_global_id(0);
  out[n] = bit_run(in[n].x, in[n].y);
}
__kernel void test_bits(__global int2* out, __global const ulong* in) {
  const int n = get_global_id(0);
  out[n] = (int2)(lowest_bit(in[n]), highest_bit(in[n]));
}
__kernel void test_places(__global int4* out, __global const int4* in, const Grid g) {
  const int first = LANES * get_global_id(0);
  const Quads q = load_quads((__global const uint4*)(in + first));
  const Voxels v = {as_intv(q.x), as_intv(q.y), as_intv(q.z)};
  const intv row = voxel_halves(&g, v), tile = candidate_halves(&g, v);
  store_elements(row, tile, half_bits(v.k), same_voxels(v, voxels_of(&g, 32 * tile + (v.k & 31))), first, out);
}
__kernel void test_words(__global int4* out, __global const int4* in, const Grid g) {
  const int n = get_global_id(0);
  out[n] = (int4)(word_index(&g, in[n].x, in[n].y, in[n].z), tile_word_index(&g, in[n].x, in[n].y, in[n].z), 0, 0);
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

/// @param around  largest distance of the points from the grid [voxel]
std::vector<cl_float4> random_points(const Nuvg& grid, int count, double around, Random& random) {
  std::vector<cl_float4> points;
  for (int n = 0; n < count; ++n) {
    const Vector3d c(random.uniform(-around, grid.size_i + around), random.uniform(-around, grid.size_j + around),
                     random.uniform(-around, grid.size_k + around));
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
    const std::vector<cl_float4> points = random_points(grid, 200, 20, random);
    const auto c = kernels().run_lanes<cl_float4>("test_to_grid", points, 1, device_grid);
    for (std::size_t n = 0; n < points.size(); ++n) {
      const Vector3d p = unpack4(points[n]);
      EXPECT_LT((unpack4(c[n]) - grid.to_grid(p)).norm(), 1e-3) << p.transpose();
      EXPECT_NEAR(c[n].s[3], grid.voxel_size(p.z()), 1e-6);
    }
  }
}

std::vector<cl_int4> all_voxels(const Grid& grid) {
  std::vector<cl_int4> voxels;
  for_each_voxel(grid, [&](int i, int j, int k) { voxels.push_back({{i, j, k, 0}}); });
  return voxels;
}

/// F^-1 of voxel centres. F and rounding must lead back to the same voxels.
TEST(StageGrid, InverseOfF) {
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    const Nuvg grid(camera.intrinsics, camera.config);
    const ViewGrid view = make_view_grid(camera.intrinsics, camera.config);
    DeviceArray<float> layer_depth(test_commands());
    layer_depth.write(view.layer_depth);
    const std::vector<cl_int4> v = all_voxels(view.grid);
    const auto centers = kernels().run_lanes<cl_float4>("test_voxel_centers", v, 1, view.grid, layer_depth());
    const auto back = kernels().run_lanes<cl_int4>("test_voxels_at", centers, 1, view.grid);
    for (std::size_t n = 0; n < v.size(); ++n) {
      const Vector3d expected = grid.center_of(v[n].s[0], v[n].s[1], v[n].s[2]);
      ASSERT_LT((unpack4(centers[n]) - expected).norm(), 1e-3 * grid.voxel_size(expected.z())) << expected.transpose();
      for (int axis = 0; axis < 3; ++axis) ASSERT_EQ(back[n].s[axis], v[n].s[axis]) << expected.transpose();
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
    const auto c = kernels().run_lanes<cl_float4>("test_to_grid", points, 1, g);
    for (std::size_t n = 0; n < points.size(); ++n) EXPECT_NEAR(c[n].s[2], g.k_min, 1e-4);
    for (std::size_t n = 0; n < points.size(); n += 3) EXPECT_LT((unpack4(c[n]) - unpack4(c[n + 2])).norm(), 1e-3);
  }
}

/// Points in the grid and around it, in the cuboid, behind the camera, far away, at borders between voxels, and at z_min and its
/// neighbouring floats.
std::vector<cl_float4> awkward_points(const Nuvg& grid, Random& random) {
  std::vector<cl_float4> all = random_points(grid, 800, 5, random);
  const auto z_min = static_cast<float>(grid.z_min);
  for (int n = 0; n < 800; ++n) {
    all.push_back(pack4(random.uniform(0, 100) * random.direction()));
    all.push_back(pack4({random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-grid.z_min, grid.z_min)}));
    all.push_back(pack4(
        grid.from_grid({random.whole(-1, grid.size_i) + 0.5, random.whole(-1, grid.size_j) + 0.5, random.whole(-1, grid.size_k) + 0.5})));
    all.push_back(pack4({random.uniform(-1, 1), random.uniform(-1, 1), 0}));
    for (const float z : {std::nextafter(z_min, 0.0F), z_min, std::nextafter(z_min, 1.0F)})
      all.push_back({{static_cast<float>(random.uniform(-0.5, 0.5)), static_cast<float>(random.uniform(-0.5, 0.5)), z, 0}});
  }
  return all;
}

TEST(StageGrid, VoxelsOfPoints) {
  for (const CameraSetup& camera : grids()) {
    SCOPED_TRACE(camera.name);
    Random random(3);
    const Nuvg grid(camera.intrinsics, camera.config);
    const std::vector<cl_float4> p = awkward_points(grid, random);
    const auto v = kernels().run_lanes<cl_int4>("test_voxels_at", p, 1, make_view_grid(camera.intrinsics, camera.config).grid);
    std::size_t inside = 0, cuboid = 0;
    Comparison comparison("inside");
    for (std::size_t n = 0; n < p.size(); ++n) {
      const Voxel expected = voxel_of(grid.to_grid(unpack4(p[n])), 1e-3);
      if (expected.open) continue;
      comparison.add(truth(grid.contains(expected.index)), v[n].s[3] != 0, [&] { return "a point"; });
      if (v[n].s[3] == 0) continue;
      EXPECT_EQ(v[n].s[3], -1) << "a mark is -1";
      ++inside;
      cuboid += p[n].s[2] < grid.z_min;
      EXPECT_EQ(Vector3i(v[n].s[0], v[n].s[1], v[n].s[2]), expected.index) << unpack4(p[n]).transpose();
    }
    EXPECT_GT(inside, 50u) << "nothing was tested";
    EXPECT_GT(cuboid, 10u) << "nothing was tested";
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
  while (x.size() < 40000)
    x.push_back(
        static_cast<float>(random.chance(0.2) ? random.uniform(0.9, 1.1) : std::exp(random.uniform(std::log(1e-6), std::log(1e6)))));
  const auto out = kernels().run_lanes<float>("test_natural_log", x, 1);
  double worst = 0;
  for (std::size_t n = 0; n < x.size(); ++n) {
    const double expected = std::log(static_cast<double>(x[n]));
    worst = std::max(worst, std::abs(out[n] - expected) / std::max(1.0, std::abs(expected)));
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
  while (x.size() < 1600) x.push_back(static_cast<float>(random.uniform(-3000, 3000)));
  const auto out = kernels().run_lanes<cl_int4>("test_rounding", x, 1);
  for (std::size_t n = 0; n < x.size(); ++n) {
    EXPECT_EQ(out[n].s[0], std::floor(x[n])) << "lanes, of " << x[n];
    EXPECT_EQ(out[n].s[1], std::ceil(x[n])) << "lanes, of " << x[n];
    EXPECT_EQ(out[n].s[2], std::floor(x[n])) << x[n];
    EXPECT_EQ(out[n].s[3], std::ceil(x[n])) << x[n];
  }
}

TEST(StageGrid, Quotients) {
  Random random(9);
  std::vector<cl_int> a = {0, 1, std::numeric_limits<cl_int>::max()};
  for (int n = 0; n < 2000; ++n) a.push_back(static_cast<cl_int>(random.bits() >> random.whole(1, 31)));
  for (const int divisor : {1, 2, 3, 7, 22, 1000, 46341, 1 << 20})
    for (const int multiple : {1, 5, 1000})
      for (const int off : {-1, 0, 1}) a.push_back(multiple * std::min(divisor, 1000000) + off);
  for (const cl_int divisor : {1, 2, 3, 7, 22, 1000, 46341, 1 << 20}) {
    const auto out = kernels().run_lanes<cl_int>("test_quotients", a, 1, divisor);
    for (std::size_t n = 0; n < a.size(); ++n) EXPECT_EQ(out[n], a[n] / divisor) << a[n] << " / " << divisor;
  }
}

TEST(StageGrid, Transforms) {
  Random random(4);
  const Eigen::Isometry3d T = random.pose(3, 3);
  std::vector<cl_float4> points;
  for (int n = 0; n < 20; ++n) points.push_back(pack4(random.direction()));
  const auto moved = kernels().run_lanes<cl_float4>("test_transformed", points, 1, to_transform(T));
  const auto turned = kernels().run_lanes<cl_float4>("test_rotated", points, 1, to_transform(T));
  for (std::size_t n = 0; n < points.size(); ++n) {
    EXPECT_LT((unpack4(moved[n]) - T * unpack4(points[n])).norm(), 1e-5);
    EXPECT_LT((unpack4(turned[n]) - T.linear() * unpack4(points[n])).norm(), 1e-5);
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

/// Positions of voxels in bit fields, by rows and by tiles, and voxels of listed candidates.
TEST(StageGrid, LayoutOfBitFields) {
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    const Grid g = make_view_grid(camera.intrinsics, camera.config).grid;
    const std::vector<cl_int4> v = all_voxels(g);
    const auto places = kernels().run_lanes<cl_int4>("test_places", v, 1, g);
    std::vector<cl_int4> of_words;
    for (const cl_int4& voxel : v) of_words.push_back({{voxel.s[0], voxel.s[1], voxel.s[2] / 64, 0}});
    const auto words = kernels().run<cl_int4>("test_words", of_words.size(), of_words, of_words.size(), g);
    const int tiles_i = (g.size_i + VIEW_TILE - 1) / VIEW_TILE;
    for (std::size_t n = 0; n < v.size(); ++n) {
      const auto [i, j, k, unused] = v[n].s;
      const int row = (j * g.words_k + k / 64) * g.size_i + i;
      const int tile = (j / VIEW_TILE * g.words_k + k / 64) * tiles_i + i / VIEW_TILE;
      const int tile_word = (tile * VIEW_TILE + j % VIEW_TILE) * VIEW_TILE + i % VIEW_TILE, half = k / 32 % 2;
      ASSERT_EQ(words[n].s[0], row);
      ASSERT_EQ(words[n].s[1], tile_word);
      ASSERT_EQ(places[n].s[0], 2 * row + half);
      ASSERT_EQ(places[n].s[1], 2 * tile_word + half);
      ASSERT_EQ(static_cast<cl_uint>(places[n].s[2]), 1U << k % 32);
      ASSERT_EQ(places[n].s[3], -1) << "voxel of a listed candidate";
    }

    std::vector<cl_int> all_words(g.words_k);
    for (int w = 0; w < g.words_k; ++w) all_words[w] = w;
    const auto layers = kernels().run<cl_ulong>("test_valid_layers", all_words.size(), all_words, all_words.size(), g);
    for (int k = 0; k < 64 * g.words_k; ++k) EXPECT_EQ(layers[k / 64] >> (k % 64) & 1, k < g.size_k ? 1u : 0u) << "layer " << k;
  }
}

}  // namespace
}  // namespace frontier_surfels
