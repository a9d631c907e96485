/// Cameras that take turns keep their grids and tables on the device.

#include <gtest/gtest.h>

#include "frame/camera.hpp"
#include "stages/random_input.hpp"
#include "stages/test_device.hpp"

namespace frontier_surfels {
namespace {

using reference::cameras;
using reference::CameraSetup;

TEST(Cameras, CamerasThatTakeTurnsAreKept) {
  const std::vector<CameraSetup> setups = cameras();
  Cameras list(test_commands(), setups.front().config);
  std::vector<const Camera*> first;
  for (const CameraSetup& setup : setups) first.push_back(&list.find(setup.intrinsics));
  const std::size_t bytes = test_commands().allocated_bytes();
  for (int round = 0; round < 3; ++round)
    for (std::size_t n = 0; n < setups.size(); ++n) {
      const Camera& camera = list.find(setups[n].intrinsics);
      EXPECT_EQ(&camera, first[n]);
      EXPECT_TRUE(same_camera(camera.intrinsics(), setups[n].intrinsics));
    }
  EXPECT_EQ(test_commands().allocated_bytes(), bytes) << "tables are made anew";
}

TEST(Cameras, EveryIntrinsicCounts) {
  const CameraSetup setup = cameras().front();
  Cameras list(test_commands(), setup.config);
  const Camera* first = &list.find(setup.intrinsics);
  std::vector<Intrinsics> others(6, setup.intrinsics);
  others[0].fx += 1e-9;
  others[1].fy += 1;
  others[2].cx += 1;
  others[3].cy += 1;
  others[4].width += 1;
  others[5].height += 1;
  for (const Intrinsics& other : others) EXPECT_NE(&list.find(other), first);
  EXPECT_EQ(&list.find(setup.intrinsics), first);
}

/// A driver whose intrinsics change with every image must not fill the memory.
TEST(Cameras, NumberIsBounded) {
  const CameraSetup setup = cameras().front();
  Cameras list(test_commands(), setup.config);
  Intrinsics intrinsics = setup.intrinsics;
  std::size_t after_many = 0;
  for (int n = 0; n < 100; ++n) {
    intrinsics.fx += 1e-6;
    list.find(intrinsics);
    if (n == 50) after_many = test_commands().allocated_bytes();
  }
  EXPECT_EQ(test_commands().allocated_bytes(), after_many);
}

}  // namespace
}  // namespace frontier_surfels
