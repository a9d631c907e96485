/// Surfels that a frame would split into more smaller ones than 32 bits can count.
#include <gtest/gtest.h>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

/// Surfels of 2 m radius half a metre before the camera: each becomes 4096 small ones.
std::vector<Surfel> large_surfels(std::size_t count) {
  std::vector<Surfel> surfels(count);
  for (std::size_t n = 0; n < count; ++n) {
    surfels[n].position = {0.0001F * static_cast<float>(n % 1024) - 0.05F, 0.0001F * static_cast<float>(n / 1024) - 0.05F, 0.5F};
    surfels[n].normal = {0, 0, -1};
    surfels[n].radius = 2;
  }
  return surfels;
}

TEST(MapperSplits, MoreThan32BitsCount) {
  const Intrinsics camera = plain_camera(80, 60, 250);
  const auto nothing_measured = plane_frame(camera, 0);
  Mapper mapper(undecimated());
  mapper.load(large_surfels(2));
  EXPECT_EQ(mapper.integrate(nothing_measured.view()).split, 2u * 4095) << "the test needs surfels that are split six times";

  constexpr std::size_t kParents = 1 << 20;  // with 4096 children each: 2^32
  mapper.load(large_surfels(kParents));
  const std::string said = fault_of<BadFrame>([&] { mapper.integrate(nothing_measured.view()); });
  EXPECT_NE(said.find("split"), std::string::npos) << said;
  EXPECT_NE(said.find("decimation"), std::string::npos) << said;
  EXPECT_EQ(mapper.size(), kParents);
  EXPECT_EQ(mapper.surfels().size(), kParents);
}

}  // namespace
}  // namespace frontier_surfels
