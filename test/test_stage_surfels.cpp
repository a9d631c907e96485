/// kernels/common/surfels.cl: LANES surfels at a time compared with one after the other. test_surfel_packing tests the packing.

#include <gtest/gtest.h>

#include "frame/recent_views.hpp"
#include "frame/view_grid.hpp"
#include "stages/reference_surfels.hpp"
#include "stages/test_kernels.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// Each work item handles LANES points or surfels. Output: all results of vectors, followed by all results of one at a time.
const char* const kSource = R"CL(
__kernel void test_voxels(__global int4* out, __global const float4* in, const Grid g) {
  const int n = get_global_id(0), all = LANES * get_global_size(0);
  float x[LANES], y[LANES], z[LANES];
  for (int lane = 0; lane < LANES; ++lane) {
    x[lane] = in[LANES * n + lane].x;
    y[lane] = in[LANES * n + lane].y;
    z[lane] = in[LANES * n + lane].z;
  }
  const Voxels v = voxels_at(&g, (Points){vload16(0, x), vload16(0, y), vload16(0, z)});
  int i[LANES], j[LANES], k[LANES], inside[LANES];
  vstore16(inside_grid16(&g, v), 0, inside);
  vstore16(v.i, 0, i);
  vstore16(v.j, 0, j);
  vstore16(v.k, 0, k);
  for (int lane = 0; lane < LANES; ++lane) {
    out[LANES * n + lane] = (int4)(i[lane], j[lane], k[lane], inside[lane]);
    const int3 one = voxel_of(to_grid(&g, in[LANES * n + lane].xyz));
    out[all + LANES * n + lane] = (int4)(one, inside_grid(&g, one) ? -1 : 0);
  }
}
__kernel void test_load(__global float* out, __global const uint4* in, const Window window, const Transform T, const int4 block) {
  const int n = get_global_id(0), all = LANES * get_global_size(0);
  const Surfels s = load_surfels(&window, &T, in, block, LANES * n);
  const Points normal = stored_normals(&s, &T);
  const float16 fields[9] = {s.position.x, s.position.y, s.position.z, s.radius, normal.x, normal.y, normal.z, as_float16(s.normal),
                             as_float16(s.attributes)};
  for (int field = 0; field < 9; ++field) vstore16(fields[field], 0, out + field * all + LANES * n);
  out += 9 * all;
  for (int lane = LANES * n; lane < LANES * n + LANES; ++lane) {
    const float3 p = transform_point(&T, surfel_position(&window, in[lane], block)), normal = rotate(&T, unpack_normal(in[lane].z));
    const float one[9] = {p.x,      p.y,      p.z, surfel_radius(in[lane]), normal.x, normal.y, normal.z, as_float(in[lane].z),
                          as_float(in[lane].w)};
    for (int field = 0; field < 9; ++field) out[field * all + lane] = one[field];
  }
}
__kernel void test_lanes(__global ulong* out, __global const int* in) {
  __local ushort lanes[PAGE_SLOTS / LANES];
  for (int part = 0; part < PAGE_SLOTS / LANES; ++part) lanes[part] = (ushort)lane_bits(vload16(part, in + PAGE_SLOTS * get_global_id(0)));
  out[get_global_id(0)] = pack_lanes(lanes);
}
__kernel void test_marks(__global int* out, __global const ulong* in) {
  const int n = get_global_id(0);
  for (int part = 0; part < PAGE_SLOTS / LANES; ++part)
    vstore16(lane_marks(lanes_of_page(in[n], LANES * part)), part, out + PAGE_SLOTS * n);
}
)CL";

TestKernels& kernels() {
  static auto* const kernels = new TestKernels(kSource);
  return *kernels;
}

/// Points in the grid and around it, in the cuboid, behind the camera, far away, and at z_min to the last bit.
std::vector<cl_float4> points(const Nuvg& grid, Random& random) {
  std::vector<cl_float4> all;
  const auto z_min = static_cast<float>(grid.z_min);
  const auto add = [&](const Vector3d& p) {
    all.push_back({{static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()), 0}});
  };
  for (int n = 0; n < 800; ++n) {
    add(grid.from_grid({random.uniform(-5, grid.size_i + 5), random.uniform(-5, grid.size_j + 5), random.uniform(-5, grid.size_k + 5)}));
    add(random.uniform(0, 100) * random.direction());
    add({random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-grid.z_min, grid.z_min)});
    add(grid.from_grid({random.whole(-1, grid.size_i) + 0.5, random.whole(-1, grid.size_j) + 0.5, random.whole(-1, grid.size_k) + 0.5}));
    add({random.uniform(-1, 1), random.uniform(-1, 1), 0});
    for (const float z : {std::nextafter(z_min, 0.0F), z_min, std::nextafter(z_min, 1.0F)})
      add({random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), z});
  }
  return all;
}

TEST(StageSurfels, VoxelsOfPoints) {
  std::vector<CameraSetup> all = cameras();
  all.push_back(make_camera(160, 120, 131.25, 131.25, 369));
  all.push_back(make_camera(20, 20, 10, 50, 60));
  for (const CameraSetup& camera : all) {
    SCOPED_TRACE(camera.name);
    Random random(1);
    const Nuvg grid(camera.intrinsics, camera.config);
    const std::vector<cl_float4> p = points(grid, random);
    const auto v =
        kernels().run<cl_int4>("test_voxels", p.size() / LANES, p, 2 * p.size(), make_view_grid(camera.intrinsics, camera.config).grid);
    std::size_t inside = 0, cuboid = 0;
    Comparison comparison("inside");
    for (std::size_t n = 0; n < p.size(); ++n) {
      const cl_int4 &of_lane = v[n], &one = v[p.size() + n];
      const Vector3d at(p[n].s[0], p[n].s[1], p[n].s[2]);
      for (int axis = 0; axis < 4; ++axis) ASSERT_EQ(of_lane.s[axis], one.s[axis]) << at.transpose();
      const Voxel expected = voxel_of(grid.to_grid(at), 1e-3);
      if (expected.open) continue;
      comparison.add(truth(grid.contains(expected.index)), of_lane.s[3] != 0, [&] { return "a point"; });
      if (of_lane.s[3] == 0) continue;
      ++inside;
      cuboid += at.z() < grid.z_min;
      EXPECT_EQ(Vector3i(of_lane.s[0], of_lane.s[1], of_lane.s[2]), expected.index) << at.transpose();
    }
    EXPECT_GT(inside, 50u) << "nothing was tested";
    EXPECT_GT(cuboid, 10u) << "nothing was tested";
  }
}

TEST(StageSurfels, Loading) {
  Random random(2);
  for (const double block_size : {0.5, 2.0})
    for (int run = 0; run < 10; ++run) {
      const Window window = {random.whole(-2000, 2000),     random.whole(-9, 9), random.whole(-9, 9), 20, 20, 20,
                             static_cast<float>(block_size)};
      const cl_int4 block = {{window.origin_x + random.whole(0, 19), window.origin_y + random.whole(0, 19), window.origin_z, 77}};
      std::vector<cl_uint4> surfels;
      for (int n = 0; n < 256; ++n) {
        Surfel surfel;
        surfel.normal = (random.chance(0.2) ? Vector3d(0, 0, random.chance(0.5) ? 1 : -1) : random.direction()).cast<float>();
        surfel.radius = static_cast<float>(std::pow(10, random.uniform(-4, 2)));
        cl_uint4 packed = frontier_surfels::pack(surfel, BlockKey{0, 0, 0}, block_size);
        packed.s[0] = random.bits();
        packed.s[1] = (packed.s[1] & 0xffff0000U) | (random.bits() & 0xffffU);
        packed.s[3] = random.bits();
        surfels.push_back(packed);
      }
      const Transform T = to_transform(random.pose(5, 3));
      const auto out = kernels().run<float>("test_load", surfels.size() / LANES, surfels, 18 * surfels.size(), window, T, block);
      for (std::size_t n = 0; n < 9 * surfels.size(); ++n) {
        const std::size_t field = n / surfels.size();
        if (field >= 4 && field < 7) {
          EXPECT_NEAR(out[n], out[9 * surfels.size() + n], 5e-7) << "normal, " << field - 4;
        } else {
          EXPECT_EQ(std::memcmp(&out[n], &out[9 * surfels.size() + n], 4), 0) << "field " << field;
        }
      }
    }
}

TEST(StageSurfels, BitsOfLanes) {
  Random random(3);
  std::vector<cl_ulong> expected = {0, ~cl_ulong{0}};
  for (int bit = 0; bit < 64; ++bit) expected.push_back(cl_ulong{1} << bit);
  for (int n = 0; n < 200; ++n) expected.push_back(static_cast<cl_ulong>(random.bits()) << 32 | random.bits());
  std::vector<cl_int> lanes;
  for (const cl_ulong word : expected)
    for (int bit = 0; bit < 64; ++bit) lanes.push_back(word >> bit & 1 ? -1 : 0);
  EXPECT_TRUE(kernels().run<cl_ulong>("test_lanes", expected.size(), lanes, expected.size()) == expected);
  EXPECT_TRUE(kernels().run<cl_int>("test_marks", expected.size(), expected, lanes.size()) == lanes);
}

}  // namespace
}  // namespace frontier_surfels
