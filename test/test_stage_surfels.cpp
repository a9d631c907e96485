/// kernels/common/surfels.cl and the marks of lanes.cl, LANES surfels at a time. test_surfel_packing tests the packing.

#include <gtest/gtest.h>

#include "frame/recent_views.hpp"
#include "stages/reference_surfels.hpp"
#include "stages/test_kernels.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

const char* const kSource = R"CL(
// out[3][n]: position and radius; normal; bits of the packed normal and the attributes.
INLINE void store_surfels(const Surfels* s, int first, int count, __global float4* out) {
  const Points normal = unpack_normals(s->normal);
  store_elements(s->position.x, s->position.y, s->position.z, s->radius, first, out);
  store_elements(normal.x, normal.y, normal.z, 0.0f, count + first, out);
  store_elements(as_floatv(s->normal), as_floatv(s->attributes), 0.0f, 0.0f, 2 * count + first, out);
}
__kernel void test_load(__global float4* out, __global const uint4* in, const Window window, const int4 block) {
  const int first = LANES * get_global_id(0);
  const Surfels s = load_surfels(&window, in, block, first);
  store_surfels(&s, first, LANES * get_global_size(0), out);
}
// Handles the slots from the last to the first. The pages belong to consecutive blocks along x.
__kernel void test_slots(__global float4* out, __global const uint4* in, const Window window, __global const int4* page_block) {
  const int first = LANES * get_global_id(0), count = LANES * get_global_size(0);
  const Surfels s = surfels_at(&window, in, page_block, as_uintv(count - 1 - first - lane_numbers()));
  store_surfels(&s, first, count, out);
}
__kernel __attribute__((reqd_work_group_size(PAGE_GROUP, 1, 1))) void test_shared_words(__global ulong* out, __global const int* in) {
  __local SharedWord words[PAGE_GROUP / PAGE_ITEMS];
  const int word = get_local_id(0) / PAGE_ITEMS, item = get_local_id(0) % PAGE_ITEMS;
  words[word] = (SharedWord){{0xffff, 0xffff}};  // earlier contents must not matter
  barrier(CLK_LOCAL_MEM_FENCE);
  share_lane_bits(lane_bits(vloadv(get_global_id(0), in)), item, &words[word]);
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item == 0) out[get_global_id(0) / PAGE_ITEMS] = read_shared_word(&words[word]);
}
__kernel void test_stored_words(__global ulong* out, __global const int* in) {
  store_lane_bits(lane_bits(vloadv(get_global_id(0), in)), get_global_id(0), (__global uint*)out);
}
__kernel void test_marks(__global int* out, __global const ulong* in) {
  const int n = get_global_id(0) / PAGE_ITEMS, first = LANES * (get_global_id(0) % PAGE_ITEMS);
  vstorev(lane_marks(lanes_of_page(in[n], first)), get_global_id(0), out);
}
__kernel void test_comparisons(__global int4* out, __global const float4* in) {
  const int first = LANES * get_global_id(0);
  const Points p = load_points(in + first);
  const intv less = MARK(p.x < p.y), both = MARK(p.x < p.y) & MARK(p.y < p.z);
  const floatv smaller = less ? p.x : p.y;
  store_elements(less, both, ~less & MARK(p.y < p.z), as_intv(smaller), first, out);
}
)CL";

TestKernels& kernels() {
  static auto* const kernels = new TestKernels(kSource);
  return *kernels;
}

std::vector<cl_uint4> random_packed(int count, double block_size, Random& random) {
  std::vector<cl_uint4> surfels;
  for (int n = 0; n < count; ++n) {
    Surfel surfel;
    surfel.normal = (random.chance(0.2) ? Vector3d(0, 0, random.chance(0.5) ? 1 : -1) : random.direction()).cast<float>();
    surfel.radius = static_cast<float>(std::pow(10, random.uniform(-4, 2)));
    cl_uint4 packed = frontier_surfels::pack(surfel, BlockKey{0, 0, 0}, block_size);
    packed.s[0] = random.bits();
    packed.s[1] = (packed.s[1] & 0xffff0000U) | (random.bits() & 0xffffU);
    packed.s[3] = random.bits();
    surfels.push_back(packed);
  }
  return surfels;
}

float as_float(cl_uint bits) {
  float value;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

/// @param block  block of the surfel, relative to the window's first block
/// @param out    the kernel's output for the surfel, out[3][count] from the surfel's first entry on
void expect_unpacked(const cl_uint4& packed, const BlockKey& block, double block_size, const cl_float4* out, std::size_t count) {
  const Surfel host = unpack(packed, block, block_size);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(out[0].s[axis], host.position[axis]) << "must be exact";
    EXPECT_NEAR(out[count].s[axis], host.normal[axis], 5e-7);
  }
  EXPECT_EQ(out[0].s[3], host.radius);
  const float bits[] = {as_float(packed.s[2]), as_float(packed.s[3])};
  EXPECT_EQ(std::memcmp(out[2 * count].s, bits, sizeof(bits)), 0);
}

TEST(StageSurfels, Loading) {
  Random random(2);
  for (const double block_size : {0.5, 2.0})
    for (int run = 0; run < 10; ++run) {
      const Window window = {random.whole(-2000, 2000),     random.whole(-9, 9), random.whole(-9, 9), 20, 20, 20,
                             static_cast<float>(block_size)};
      const BlockKey block = {random.whole(0, 19), random.whole(0, 19), 0};  // relative to the window's first block
      const cl_int4 in_world = {{window.origin_x + block.x, window.origin_y + block.y, window.origin_z, 77}};
      const std::vector<cl_uint4> surfels = random_packed(256, block_size, random);
      const auto out =
          kernels().run<cl_float4>("test_load", test_commands().chunks(surfels.size()), surfels, 3 * surfels.size(), window, in_world);
      for (std::size_t n = 0; n < surfels.size(); ++n) expect_unpacked(surfels[n], block, block_size, &out[n], surfels.size());
    }
}

TEST(StageSurfels, OfAnySlots) {
  Random random(4);
  constexpr double kBlockSize = 0.5;
  const Window window = {-300, 5, 70, 20, 20, 20, kBlockSize};
  const std::vector<cl_uint4> surfels = random_packed(4 * PAGE_SLOTS, kBlockSize, random);
  std::vector<cl_int4> page_block;
  for (int page = 0; page < 4; ++page)
    page_block.push_back({{window.origin_x + page, window.origin_y + 3, window.origin_z + 9 - page, 77}});
  DeviceArray<cl_int4> blocks(test_commands());
  blocks.write(page_block);
  const std::size_t count = surfels.size();
  const auto out = kernels().run<cl_float4>("test_slots", test_commands().chunks(count), surfels, 3 * count, window, blocks());
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t slot = count - 1 - n;
    const int page = static_cast<int>(slot / PAGE_SLOTS);
    expect_unpacked(surfels[slot], {page, 3, 9 - page}, kBlockSize, &out[n], count);
  }
}

TEST(StageSurfels, BitsOfLanes) {
  Random random(3);
  std::vector<cl_ulong> words = {0, ~cl_ulong{0}};
  for (int bit = 0; bit < 64; ++bit) words.push_back(cl_ulong{1} << bit);
  while (words.size() < 272) words.push_back(static_cast<cl_ulong>(random.bits()) << 32 | random.bits());
  std::vector<cl_int> marks;
  for (const cl_ulong word : words)
    for (int bit = 0; bit < 64; ++bit) marks.push_back(word >> bit & 1 ? -1 : 0);
  const std::size_t items = test_commands().chunks(marks.size());
  EXPECT_TRUE(kernels().run<cl_ulong>("test_shared_words", items, marks, words.size()) == words);
  EXPECT_TRUE(kernels().run<cl_ulong>("test_stored_words", items, marks, words.size()) == words);
  EXPECT_TRUE(kernels().run<cl_int>("test_marks", items, words, marks.size()) == marks);
}

TEST(StageSurfels, Marks) {
  std::vector<cl_float4> in;
  for (const float x : {-1.0F, 0.0F, 2.0F, std::nanf("")})
    for (const float y : {-1.0F, 0.0F, 2.0F})
      for (const float z : {-1.0F, 0.0F, 2.0F}) in.push_back({{x, y, z, 0}});
  const auto out = kernels().run_lanes<cl_int4>("test_comparisons", in, 1);
  for (std::size_t n = 0; n < in.size(); ++n) {
    const auto [x, y, z, unused] = in[n].s;
    EXPECT_EQ(out[n].s[0], x < y ? -1 : 0);
    EXPECT_EQ(out[n].s[1], x < y && y < z ? -1 : 0);
    EXPECT_EQ(out[n].s[2], !(x < y) && y < z ? -1 : 0);
    EXPECT_EQ(as_float(out[n].s[3]), x < y ? x : y);
  }
}

}  // namespace
}  // namespace frontier_surfels
