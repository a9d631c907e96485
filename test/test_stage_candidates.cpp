/// kernels/stages/4_candidates.cl compared exactly with eq. (13), evaluated one voxel at a time.

#include <gtest/gtest.h>

#include "stages/frame_fixture.hpp"
#include "stages/reference_paths.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

void check(const CameraSetup& camera, double observed_density) {
  SCOPED_TRACE(camera.name + ", density " + std::to_string(observed_density));
  Random random(5);
  FrameFixture fixture(camera.config);
  fixture.begin(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
  const Field<char> observed = random_field(fixture.grid(), observed_density, random);
  BitField observed_bits(fixture.commands());
  fixture.write(observed_bits, observed);
  Candidates found(fixture.commands());
  found.visit_counts().write(std::vector<cl_uint>(COUNTS, 5));
  found.find(fixture.camera().grid(), observed_bits);
  expect_equal("candidates", candidates(observed), fixture.read(found));
  EXPECT_EQ(found.visit_counts().read(COUNTS), std::vector<cl_uint>(COUNTS, 0)) << "the next stage's counters are not cleared";
}

TEST(StageCandidates, RandomFields) {
  for (const CameraSetup& camera : cameras()) {
    check(camera, 0.02);
    check(camera, 0.3);
  }
}

TEST(StageCandidates, EmptyAndFullFields) {
  for (const CameraSetup& camera : cameras()) {
    check(camera, 0);
    check(camera, 1);
    check(camera, 0.5);
  }
}

}  // namespace
}  // namespace frontier_surfels
