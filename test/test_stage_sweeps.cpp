/// kernels/stages/13_sweeps.cl compared exactly with Algorithm 1, walked one path at a time, on random events.

#include <gtest/gtest.h>

#include "stages/path_fields.hpp"
#include "stages/path_sweeps.hpp"
#include "stages/reference_paths.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

struct Densities {
  double event = 0, invalid = 0, hull = 0;  ///< shares of voxels, and of the hull's cells; a voxel may have several events
};

struct Input {
  explicit Input(Commands& commands) : event_bits(commands), hull_bits(commands) {}

  Events events;
  std::vector<Field<char>> hull;
  BitField event_bits, hull_bits;  ///< the same on the device
};

void fill(Input& input, const FrameFixture& fixture, const Densities& densities, Random& random) {
  const Grid& g = fixture.grid();
  for (int family = 0; family < 3; ++family)
    for (int event = 0; event < EVENT_PLANES; ++event) {
      input.events[family][event] = random_field(g, event == EVENT_INVALID ? densities.invalid : densities.event, random);
      fixture.write(input.event_bits, input.events[family][event], event_offset(g, family, event));
    }
  for (int face = FACE_I_LOW; face <= FACE_K_HIGH; ++face) {
    const bool j_face = face == FACE_J_LOW || face == FACE_J_HIGH;
    input.hull.emplace_back(j_face ? g.size_i : g.size_j, 1, face >= FACE_K_LOW ? g.size_i : g.size_k, 0);
    for (char& state : input.hull.back().values) state = random.chance(densities.hull);
  }
  write_hull(input.hull_bits, input.hull);
}

void check(const CameraSetup& camera, const Densities& densities) {
  SCOPED_TRACE(camera.name + ", densities " + std::to_string(densities.event) + " " + std::to_string(densities.hull));
  Random random(static_cast<unsigned>(1000 * densities.event));
  FrameFixture fixture(camera.config);
  fixture.begin(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
  Candidates candidates(fixture.commands());
  NeededPaths needed(fixture.commands());
  need_paths_around(fixture, Field<char>(fixture.grid(), 1), candidates, needed);
  PathSweeps sweeps(fixture.commands());
  for (int frame = 0; frame < 2; ++frame) {  // the first frame's results must not affect the second
    Input input(fixture.commands());
    fill(input, fixture, densities, random);
    sweeps.sweep(fixture.frame(), needed, input.event_bits, input.hull_bits);
    expect_equal("K'", sweep(input.events, input.hull), fixture.read(sweeps.known()));
  }
}

TEST(StageSweeps, RandomEvents) {
  for (const CameraSetup& camera : cameras()) {
    check(camera, {0.003, 0.001, 0.2});  // runs over several words
    check(camera, {0.05, 0.02, 0.5});
    check(camera, {0.4, 0.3, 0.5});
  }
}

TEST(StageSweeps, NoEvents) {
  for (const CameraSetup& camera : cameras())
    for (const double hull : {0.0, 0.1, 1.0}) check(camera, {0, 0, hull});
}

TEST(StageSweeps, AllInvalid) {
  for (const CameraSetup& camera : cameras()) check(camera, {0.5, 1, 1});
}

/// With few candidates only the paths around them are walked. K' must be right where the median reads it, and K~ at the candidates.
TEST(StageSweeps, AroundFewCandidates) {
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Random random(7);
    FrameFixture fixture(camera.config);
    fixture.begin(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity());
    Input before(fixture.commands()), input(fixture.commands());
    fill(before, fixture, {0.4, 0.3, 0.5}, random);
    fill(input, fixture, {0.05, 0.02, 0.5}, random);
    Candidates candidate_bits(fixture.commands());
    NeededPaths needed(fixture.commands());
    PathSweeps sweeps(fixture.commands());
    need_paths_around(fixture, Field<char>(fixture.grid(), 1), candidate_bits, needed);
    sweeps.sweep(fixture.frame(), needed, before.event_bits, before.hull_bits);  // its results must not affect the next ones
    const Field<char> candidates = random_field(fixture.grid(), 0.001, random);
    need_paths_around(fixture, candidates, candidate_bits, needed);
    sweeps.sweep(fixture.frame(), needed, input.event_bits, input.hull_bits);
    Median filter(fixture.commands());
    const BitField& filtered_bits = filter.filter(fixture.frame(), sweeps.known(), candidate_bits);
    const Field<char> known = sweep(input.events, input.hull), filtered = median(known, camera.config.median_votes);
    const Field<char> median_looks = around(candidates, 1), actual_known = fixture.read(sweeps.known()),
                      actual_filtered = fixture.read(filtered_bits);
    Comparison at_neighbours("K' around candidates"), at_candidates("K~ at candidates");
    for_each_voxel(known, [&](int i, int j, int k) {
      const auto place = [=] { return voxel_text(i, j, k); };
      if (median_looks(i, j, k)) at_neighbours.add(truth(known(i, j, k)), actual_known(i, j, k), place);
      if (candidates(i, j, k)) at_candidates.add(truth(filtered(i, j, k)), actual_filtered(i, j, k), place);
    });
  }
}

}  // namespace
}  // namespace frontier_surfels
