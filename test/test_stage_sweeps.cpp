/// kernels/stages/11_sweeps.cl, exactly, against Algorithm 1 walked one path at a time on random events.

#include <gtest/gtest.h>

#include "stages/reference_paths.hpp"
#include "stages/stages_probe.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

struct Densities {
  double event = 0, invalid = 0, hull = 0;  ///< shares of voxels (of cells); all events at once may fall on one voxel
};

struct Input {
  Events events;
  std::vector<Field<char>> hull;
};

Input random_input(StagesProbe& probe, const Densities& densities, Random& random) {
  const Grid& g = probe.grid();
  Input input;
  for (int family = 0; family < 3; ++family)
    for (int event = 0; event < EVENT_PLANES; ++event) {
      input.events[family][event] = random_field(g, event == EVENT_INVALID ? densities.invalid : densities.event, random);
      probe.set_event(family, event, input.events[family][event]);
    }
  for (int face = FACE_I_LOW; face <= FACE_K_HIGH; ++face) {
    const bool j_face = face == FACE_J_LOW || face == FACE_J_HIGH;
    input.hull.emplace_back(j_face ? g.size_i : g.size_j, 1, face >= FACE_K_LOW ? g.size_i : g.size_k, 0);
    for (char& state : input.hull.back().values) state = random.chance(densities.hull);
  }
  probe.set_hull(input.hull);
  probe.set_known(random_field(g, 0.5, random));  // what the last frame left must not matter
  return input;
}

void check(const Camera& camera, const Densities& densities) {
  SCOPED_TRACE(camera.name + ", densities " + std::to_string(densities.event) + " " + std::to_string(densities.hull));
  Random random(static_cast<unsigned>(1000 * densities.event));
  StagesProbe probe(camera.config);
  probe.stages().begin_frame(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity(), 1);
  const Input input = random_input(probe, densities, random);
  probe.need_all_paths();
  probe.stages().sweep_paths();
  expect_equal("K'", sweep(input.events, input.hull), probe.known());
}

TEST(StageSweeps, RandomEvents) {
  for (const Camera& camera : cameras()) {
    check(camera, {0.003, 0.001, 0.2});  // runs over several words
    check(camera, {0.05, 0.02, 0.5});
    check(camera, {0.4, 0.3, 0.5});
  }
}

TEST(StageSweeps, NoEvents) {
  for (const Camera& camera : cameras())
    for (const double hull : {0.0, 0.1, 1.0}) check(camera, {0, 0, hull});
}

TEST(StageSweeps, AllInvalid) {
  for (const Camera& camera : cameras()) check(camera, {0.5, 1, 1});
}

/// Where few candidates are left only the paths around them are walked: K' is right where the median looks, and so is K~ at the candidates.
TEST(StageSweeps, AroundFewCandidates) {
  for (const Camera& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Random random(7);
    StagesProbe probe(camera.config);
    probe.stages().begin_frame(random_image(camera, Content::all_invalid, random), Eigen::Isometry3d::Identity(), 1);
    const Input input = random_input(probe, {0.05, 0.02, 0.5}, random);
    const Field<char> candidates = random_field(probe.grid(), 0.001, random);
    probe.need_paths_around(candidates);
    probe.stages().sweep_paths();
    probe.stages().filter_median();
    const Field<char> known = sweep(input.events, input.hull), filtered = median(known, camera.config.median_votes);
    const Field<char> median_looks = around(candidates, 1), actual_known = probe.known(), actual_filtered = probe.filtered();
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
