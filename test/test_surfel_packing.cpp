/// Packing a surfel into 16 bytes: the host compared with an independent computation, and the kernels compared with the host.

#include <gtest/gtest.h>

#include "map/map_window.hpp"
#include "map/surfel_packing.hpp"
#include "stages/random_input.hpp"
#include "stages/test_kernels.hpp"

namespace frontier_surfels {
namespace {

using Eigen::Vector3d;
using reference::Random;

/// A surfel unpacked by the format's definition, in double precision.
struct Unpacked {
  Vector3d position, normal;
  double radius;
};

double signed_16(std::uint32_t bits) { return bits < 0x8000 ? bits : static_cast<double>(bits) - 65536; }

Unpacked unpack_slowly(const cl_uint4& packed, const BlockKey& block, double block_size) {
  const auto [x, y, z, w] = packed.s;
  const double within[] = {double(x % 65536), double(x / 65536), double(y % 65536)};
  Unpacked surfel;
  surfel.position = Vector3d((block.x + (within[0] + 0.5) / 65536) * block_size, (block.y + (within[1] + 0.5) / 65536) * block_size,
                             (block.z + (within[2] + 0.5) / 65536) * block_size);
  const int half = static_cast<int>(y / 65536);  // sign 1, exponent 5, mantissa 10 bits
  surfel.radius = std::ldexp(1 + (half % 1024) / 1024.0, half / 1024 % 32 - 15);
  // (a, b) are x and y on the octahedron |x| + |y| + |z| = 1. Its lower half is folded outwards, mirrored at the edges |x| + |y| = 1.
  const double a = signed_16(z % 65536) / 32767, b = signed_16(z / 65536) / 32767, up = 1 - std::abs(a) - std::abs(b);
  surfel.normal = up >= 0 ? Vector3d(a, b, up) : Vector3d(std::copysign(1 - std::abs(b), a), std::copysign(1 - std::abs(a), b), up);
  surfel.normal.normalize();
  return surfel;
}

constexpr double kNormalStep = 1e-4;  // largest angle between neighbouring normals [rad]; mapping the octahedron stretches by up to 3

Vector3d awkward_direction(Random& random) {
  switch (random.whole(0, 5)) {
    case 0:
      return random.direction();
    case 1:
      return (random.chance(0.5) ? 1 : -1) * Vector3d::Unit(random.whole(0, 2));
    case 2: {  // one tiny component of either sign
      Vector3d n = random.direction();
      n[random.whole(0, 2)] = (random.chance(0.5) ? 1 : -1) * std::pow(10, random.uniform(-40, -3));
      return n.normalized();
    }
    case 3: {  // two tiny components
      Vector3d n = (random.chance(0.5) ? 1 : -1) * Vector3d::Unit(random.whole(0, 2));
      return (n + random.uniform(0, 1e-4) * random.direction()).normalized();
    }
    case 4: {  // on an edge of the octahedron
      Vector3d n = random.direction();
      n[random.whole(0, 2)] = 0;
      return n.normalized();
    }
    default:  // diagonals
      return Vector3d(random.chance(0.5) ? 1 : -1, random.chance(0.5) ? 1 : -1, random.chance(0.5) ? 1 : -1).normalized();
  }
}

double awkward_coordinate(double around, double block_size, Random& random) {
  const double block = std::floor(around / block_size) + random.whole(-3, 3);
  switch (random.whole(0, 3)) {
    case 0:
      return block * block_size;  // on the border
    case 1:
      return std::nextafter(static_cast<float>(block * block_size), random.chance(0.5) ? -1e9F : 1e9F);
    default:
      return (block + random.uniform(0, 1)) * block_size;
  }
}

Surfel awkward_surfel(const Vector3d& around, double block_size, Random& random) {
  Surfel surfel;
  for (int axis = 0; axis < 3; ++axis) surfel.position[axis] = static_cast<float>(awkward_coordinate(around[axis], block_size, random));
  surfel.normal = awkward_direction(random).cast<float>();
  surfel.radius = static_cast<float>(std::pow(10, random.uniform(-5, 5)));
  if (random.chance(0.5)) surfel.label = Label::kOccupied;
  for (std::uint8_t& channel : surfel.rgb) channel = static_cast<std::uint8_t>(random.chance(0.5) ? 0 : random.whole(0, 255));
  return surfel;
}

/// Expects an error of at most half a step of a 16-bit float. Stored radii are limited to 6.2e-5 to 65000 m.
void expect_radius(double actual, double wanted) {
  const double clamped = std::clamp(wanted, 6.2e-5, 65000.0);
  EXPECT_LE(std::abs(actual - clamped), clamped / 2048 * 1.001);
}

const Vector3d kPlaces[] = {{0, 0, 0}, {-20, 7, -0.1}, {1000, -700, 50}, {-50000, 50000, 300}};

TEST(SurfelPacking, BlocksAreHalfOpen) {
  Random random(1);
  for (const double block_size : {0.5, 1.0, 64.0})
    for (const Vector3d& place : kPlaces)
      for (int n = 0; n < 3000; ++n) {
        const Eigen::Vector3f p = awkward_surfel(place, block_size, random).position;
        const BlockKey block = block_of(p, block_size);
        const std::int32_t key[] = {block.x, block.y, block.z};
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_LE(key[axis] * block_size, p[axis]);
          EXPECT_GT((key[axis] + 1) * block_size, p[axis]);
        }
      }
}

TEST(SurfelPacking, IsExactToAStep) {
  Random random(2);
  for (const double block_size : {0.5, 2.0})
    for (const Vector3d& place : kPlaces)
      for (int n = 0; n < 5000; ++n) {
        const Surfel surfel = awkward_surfel(place, block_size, random);
        const BlockKey block = block_of(surfel.position, block_size);
        const cl_uint4 packed = pack(surfel, block, block_size);
        const Unpacked slow = unpack_slowly(packed, block, block_size);
        SCOPED_TRACE(testing::Message() << surfel.position.transpose() << ", normal " << surfel.normal.transpose());
        EXPECT_LE((slow.position - surfel.position.cast<double>()).cwiseAbs().maxCoeff(), block_size / 65536 * 0.5000001);
        EXPECT_LT((slow.normal - surfel.normal.cast<double>()).norm(), kNormalStep);
        expect_radius(slow.radius, surfel.radius);

        const Surfel unpacked = unpack(packed, block, block_size);
        EXPECT_TRUE(unpacked.position == slow.position.cast<float>());
        EXPECT_EQ(unpacked.radius, slow.radius);
        EXPECT_LT((unpacked.normal.cast<double>() - slow.normal).norm(), 1e-6);
        EXPECT_NEAR(unpacked.normal.norm(), 1, 1e-6);
        EXPECT_TRUE(unpacked.label == surfel.label && unpacked.rgb == surfel.rgb);
        const bool colored = surfel.rgb != std::array<std::uint8_t, 3>{0, 0, 0};
        EXPECT_EQ(packed.s[3] & SURFEL_COLORED, colored ? SURFEL_COLORED : 0);
        EXPECT_EQ(packed.s[3] & SURFEL_RAGGED, 0u);
      }
}

/// An unpacked surfel is packed again without loss, so that maps do not drift when they are saved and loaded repeatedly. This must hold
/// also far from the origin, where floats are coarser than the map.
TEST(SurfelPacking, RepeatedPackingLosesNothing) {
  Random random(3);
  for (const Vector3d& place : {kPlaces[0], kPlaces[1], Vector3d(90, -100, 70), kPlaces[2], kPlaces[3]})
    for (int n = 0; n < 20000; ++n) {
      constexpr double kBlock = 0.5;
      const auto again = [](const Surfel& surfel) {
        const BlockKey block = block_of(surfel.position, kBlock);
        return unpack(pack(surfel, block, kBlock), block, kBlock);
      };
      const Surfel once = again(awkward_surfel(place, kBlock, random)), twice = again(once);
      EXPECT_TRUE(once.position == twice.position) << once.position.transpose() << " became " << twice.position.transpose();
      EXPECT_TRUE(once.normal == twice.normal) << once.normal.transpose() << " became " << twice.normal.transpose();
      EXPECT_EQ(once.radius, twice.radius);
    }
}

/// Numbers per surfel in the kernel's output: packed (4), cell and its block (4), then unpacked position and radius (4), normal (4).
constexpr std::size_t kOut = 16;

TestKernels& kernels() {
  static auto* const kernels = new TestKernels(R"(
// in[2] of each surfel: position and radius, normal
__kernel void pack_and_unpack(__global int4* out, __global const float4* in, const Window window) {
  const int first = LANES * get_global_id(0);
  const intv at = first + lane_numbers();
  const Quads place = gather_quads((__global const uint4*)in, as_uintv(2 * at)), direction = gather_quads((__global const uint4*)in, as_uintv(2 * at + 1));
  const Points position = {as_floatv(place.x), as_floatv(place.y), as_floatv(place.z)},
               normal = {as_floatv(direction.x), as_floatv(direction.y), as_floatv(direction.z)};
  intv cell;
  const Quads packed = pack_surfels(&window, position, as_floatv(place.w), normal, (uintv)(SURFEL_RAGGED), &cell);
  const intv x = cell % window.size_x, y = cell / window.size_x % window.size_y, z = cell / window.size_x / window.size_y;
  const Surfels s = unpack_surfels(&window, packed, (Points){convert_floatv(x), convert_floatv(y), convert_floatv(z)});
  const Points n = unpack_normals(s.normal);
  const Quads all[4] = {packed, {as_uintv(cell), as_uintv(x), as_uintv(y), as_uintv(z)},
                        {as_uintv(s.position.x), as_uintv(s.position.y), as_uintv(s.position.z), as_uintv(s.radius)},
                        {as_uintv(n.x), as_uintv(n.y), as_uintv(n.z), (uintv)(0)}};
  for (int m = 0; m < 4; ++m) scatter_quads(all[m], 4 * at + m, (intv)(-1), (__global uint4*)out);
}
)");
  return *kernels;
}

/// Packs and unpacks surfels in a kernel. @return kOut numbers for each surfel
std::vector<cl_uint> pack_and_unpack(const std::vector<Surfel>& surfels, const Window& window) {
  std::vector<std::array<cl_float4, 2>> in;
  for (const Surfel& s : surfels)
    in.push_back({{{{s.position.x(), s.position.y(), s.position.z(), s.radius}}, {{s.normal.x(), s.normal.y(), s.normal.z(), 0}}}});
  return kernels().run_lanes<cl_uint>("pack_and_unpack", in, kOut, window);
}

/// Random surfels in a window, in its local frame.
std::vector<Surfel> surfels_of(const Window& window, int count, Random& random) {
  const Eigen::Vector3f size = Eigen::Vector3f(window.size_x, window.size_y, window.size_z) * window.block_size;
  std::vector<Surfel> surfels;
  while (static_cast<int>(surfels.size()) < count) {
    const Surfel surfel = awkward_surfel(size.cast<double>() / 2, window.block_size, random);
    if ((surfel.position.array() >= 0).all() && (surfel.position.array() < size.array()).all()) surfels.push_back(surfel);
  }
  return surfels;
}

float as_float(std::uint32_t bits) {
  float value;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

/// @param out  the kernel's output for this surfel
void expect_as_on_host(const Window& window, const Surfel& surfel, const std::uint32_t* out) {
  SCOPED_TRACE(testing::Message() << surfel.position.transpose() << ", normal " << surfel.normal.transpose());
  const BlockKey block = block_of(surfel.position, window.block_size);  // relative to the window's corner
  const cl_uint4 host = pack(surfel, block, window.block_size);
  ASSERT_LT(out[4], static_cast<std::uint32_t>(window.size_x * window.size_y * window.size_z));
  const int x = out[4] % window.size_x, y = out[4] / window.size_x % window.size_y, z = out[4] / window.size_x / window.size_y;
  const auto steps = [](int key, std::uint32_t within) { return 65536LL * key + (within & 0xffff); };
  EXPECT_LE(std::abs(steps(x, out[0]) - steps(block.x, host.s[0])), 1);
  EXPECT_LE(std::abs(steps(y, out[0] >> 16) - steps(block.y, host.s[0] >> 16)), 1);
  EXPECT_LE(std::abs(steps(z, out[1]) - steps(block.z, host.s[1])), 1);
  EXPECT_LE(std::abs(static_cast<int>(out[1] >> 16) - static_cast<int>(host.s[1] >> 16)), 1) << "radius " << surfel.radius;
  EXPECT_EQ(out[3], SURFEL_RAGGED);

  const cl_uint4 packed = {{out[0], out[1], out[2], out[3]}};
  const Unpacked slow = unpack_slowly(packed, {x, y, z}, window.block_size);
  EXPECT_LT((slow.normal - surfel.normal.cast<double>()).norm(), kNormalStep);
  EXPECT_LE((slow.position - surfel.position.cast<double>()).cwiseAbs().maxCoeff(), 0.65 * window.block_size / 65536);
  expect_radius(slow.radius, surfel.radius);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(as_float(out[8 + axis]), slow.position[axis]) << "must be exact";
    EXPECT_NEAR(as_float(out[12 + axis]), slow.normal[axis], 1e-6);
  }
  EXPECT_EQ(as_float(out[11]), slow.radius);
}

TEST(SurfelPacking, KernelsPackAsTheHostDoes) {
  Random random(4);
  for (const Window& window : {Window{0, 0, 0, 9, 7, 8, 0.5F}, Window{-4000, 100000, 3, 30, 12, 5, 0.5F}, Window{-1, -2, -3, 3, 3, 3, 8}}) {
    const std::vector<Surfel> surfels = surfels_of(window, reference::small_tests() ? 200 : 5000, random);
    const std::vector<cl_uint> out = pack_and_unpack(surfels, window);
    for (std::size_t n = 0; n < surfels.size(); ++n) expect_as_on_host(window, surfels[n], &out[kOut * n]);
  }
}

/// A kernel that packs an unpacked surfel again loses nothing. Splitting does this with normals.
TEST(SurfelPacking, KernelsRepackWithoutLoss) {
  Random random(5);
  const Window window = {0, 0, 0, 9, 7, 8, 0.5F};
  std::vector<Surfel> surfels = surfels_of(window, reference::small_tests() ? 200 : 20000, random);
  for (Surfel& surfel : surfels) {
    const BlockKey block = block_of(surfel.position, window.block_size);
    surfel = unpack(pack(surfel, block, window.block_size), block, window.block_size);
  }
  const std::vector<cl_uint> out = pack_and_unpack(surfels, window);
  for (std::size_t n = 0; n < surfels.size(); ++n) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(as_float(out[kOut * n + 8 + axis]), surfels[n].position[axis]);
      EXPECT_NEAR(as_float(out[kOut * n + 12 + axis]), surfels[n].normal[axis], 5e-7) << "normal " << n;
    }
    EXPECT_EQ(as_float(out[kOut * n + 11]), surfels[n].radius);
  }
}

}  // namespace
}  // namespace frontier_surfels
