/// kernels/stages/12_median.cl, exactly, against the count of the 27 voxels.

#include <gtest/gtest.h>

#include "stages/reference_paths.hpp"
#include "stages/stages_probe.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

void check(Camera camera, double density, int votes) {
  SCOPED_TRACE(camera.name + ", density " + std::to_string(density) + ", votes " + std::to_string(votes));
  camera.config.median_votes = votes;
  Random random(static_cast<unsigned>(votes));
  StagesProbe probe(camera.config);
  probe.stages().begin_frame(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity(), 1);
  const Field<char> known = random_field(probe.grid(), density, random);
  probe.set_known(known);
  const Field<char> candidates = random_field(probe.grid(), 0.01, random);
  probe.set_candidates(candidates);
  probe.stages().filter_median();
  Field<char> expected = median(known, votes), filtered = probe.filtered();  // where there are candidates
  for (std::size_t n = 0; n < candidates.values.size(); ++n)
    if (!candidates.values[n]) expected.values[n] = filtered.values[n] = 0;
  expect_equal("K~", expected, filtered);
}

TEST(StageMedian, RandomFields) {
  for (const Camera& camera : cameras())
    for (const double density : {0.1, 0.5, 0.9}) check(camera, density, 14);
}

TEST(StageMedian, EmptyAndFullFields) {
  for (const Camera& camera : cameras())
    for (const double density : {0.0, 1.0}) check(camera, density, 14);
}

TEST(StageMedian, EveryNumberOfVotes) {
  for (int votes = 1; votes <= 27; ++votes) check(cameras().front(), votes / 27.0, votes);
}

}  // namespace
}  // namespace frontier_surfels
