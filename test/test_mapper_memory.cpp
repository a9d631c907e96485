/// Frames that are too large for the device are refused, and smaller frames still work.
#include <gtest/gtest.h>

#include <cstdlib>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

// Makes PoCL offer one GiB. Set before the first call into OpenCL, which reads it. Other devices may be too large for these tests.
const int kSmallDevice = setenv("POCL_MEMORY_LIMIT", "1", 1);

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Message of the error when a frame is integrated that is too large for the device; "" without an error.
std::string refusal(Mapper& mapper, const DepthFrame& frame) {
  return fault_of<Error>([&] { mapper.integrate(frame); });
}

/// Whether the device is one that was made small above.
bool is_small(const Mapper& mapper) { return contains(mapper.device(), "Portable Computing Language"); }

void expect_goes_on(Mapper& mapper, const std::vector<Surfel>& before, const Frames& frames) {
  EXPECT_TRUE(same(before, mapper.surfels()));
  for (const auto& frame : frames) EXPECT_NO_THROW(mapper.integrate(frame.view()));
  EXPECT_TRUE(all_sound(mapper.surfels()));
  EXPECT_GT(mapper.surfels().size(), before.size());
}

/// A grid of 1.5e9 voxels, for which the device has no memory: it is refused before any is asked for.
TEST(MapperMemory, AGridTooLargeForTheDevice) {
  const Frames frames = orbit_frames(coarse_camera(), 12, 3);
  Mapper mapper(undecimated());
  for (int n = 0; n < 3; ++n) mapper.integrate(frames[n].view());
  const auto before = mapper.surfels();
  const auto large = plane_frame(plain_camera(1400, 1400, 250), 1);
  const std::string said = refusal(mapper, large.view());
  if (said.empty() && !is_small(mapper)) GTEST_SKIP() << "The device is too large for this test: " << mapper.device();
  EXPECT_TRUE(contains(said, "this device has room for")) << said;
  EXPECT_TRUE(contains(said, "Set decimation to 2")) << said;
  expect_goes_on(mapper, before, {frames.begin() + 3, frames.end()});
}

/// The images of the recent views take more memory than the device allows; the grid does not.
TEST(MapperMemory, RecentViewsTooManyForTheDevice) {
  const Frames frames = orbit_frames(coarse_camera(), 12, 3);
  Config config = undecimated();
  config.recent_views = 1024;
  Mapper mapper(config);
  for (int n = 0; n < 3; ++n) mapper.integrate(frames[n].view());
  const auto before = mapper.surfels();
  const auto large = plane_frame(plain_camera(600, 600, 40), 1);
  const std::string said = refusal(mapper, large.view());
  if (said.empty() && !is_small(mapper)) GTEST_SKIP() << "The device is too large for this test: " << mapper.device();
  EXPECT_TRUE(contains(said, "MiB")) << said;
  expect_goes_on(mapper, before, {frames.begin() + 3, frames.end()});
}

}  // namespace
}  // namespace frontier_surfels
