/// kernels/stages/14_median.cl compared exactly with a count of the 27 voxels.

#include <gtest/gtest.h>

#include "stages/frame_fixture.hpp"
#include "stages/path_sweeps.hpp"
#include "stages/reference_paths.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

void check(CameraSetup camera, double density, int votes) {
  SCOPED_TRACE(camera.name + ", density " + std::to_string(density) + ", votes " + std::to_string(votes));
  camera.config.median_votes = votes;
  Random random(static_cast<unsigned>(votes));
  FrameFixture fixture(camera.config);
  fixture.begin(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
  const Field<char> known = random_field(fixture.grid(), density, random);
  BitField known_bits(fixture.commands());
  fixture.write(known_bits, known);
  const Field<char> candidates = random_field(fixture.grid(), 0.01, random);
  Candidates candidate_bits(fixture.commands());
  fixture.write(candidate_bits, candidates);
  Median filter(fixture.commands());
  Field<char> expected = median(known, votes),
              filtered = fixture.read(filter.filter(fixture.frame(), known_bits, candidate_bits));  // valid only at candidates
  for (std::size_t n = 0; n < candidates.values.size(); ++n)
    if (!candidates.values[n]) expected.values[n] = filtered.values[n] = 0;
  expect_equal("K~", expected, filtered);
}

TEST(StageMedian, RandomFields) {
  for (const CameraSetup& camera : cameras())
    for (const double density : {0.1, 0.5, 0.9}) check(camera, density, 14);
}

TEST(StageMedian, EmptyAndFullFields) {
  for (const CameraSetup& camera : cameras())
    for (const double density : {0.0, 1.0}) check(camera, density, 14);
}

TEST(StageMedian, EveryNumberOfVotes) {
  for (int votes = 1; votes <= 27; ++votes) check(cameras().front(), votes / 27.0, votes);
}

}  // namespace
}  // namespace frontier_surfels
