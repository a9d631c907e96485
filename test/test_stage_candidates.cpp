/// kernels/stages/2_candidates.cl, exactly, against eq. (13) one voxel at a time.

#include <gtest/gtest.h>

#include "stages/reference_paths.hpp"
#include "stages/stages_probe.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

void check(const Camera& camera, double observed_density) {
  SCOPED_TRACE(camera.name + ", density " + std::to_string(observed_density));
  Random random(5);
  StagesProbe probe(camera.config);
  probe.stages().begin_frame(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity(), 1);
  const Field<char> observed = random_field(probe.grid(), observed_density, random);
  probe.set_observed(observed);
  probe.stages().find_candidates();
  expect_equal("candidates", candidates(observed), probe.candidates());
}

TEST(StageCandidates, RandomFields) {
  for (const Camera& camera : cameras()) {
    check(camera, 0.02);
    check(camera, 0.3);
  }
}

TEST(StageCandidates, EmptyAndFullFields) {
  for (const Camera& camera : cameras()) {
    check(camera, 0);
    check(camera, 1);
    check(camera, 0.5);
  }
}

}  // namespace
}  // namespace frontier_surfels
