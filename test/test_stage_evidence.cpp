/// kernels/stages/2_evidence.cl: which measured surfaces stand where space was known to be free, compared with asking every last frame and
/// every older kept view of every pixel, in double precision.

#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <utility>

#include "stages/lattice_input.hpp"
#include "stages/taking_back_fixture.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

constexpr double kTolerance = 1e-5;  ///< of depths in float [m]

/// Calls visit(column, row) for every pixel that a point of a camera's frame may lie in, as float may be wrong, if the image has all 8
/// pixels around it; visit(-1, -1) stands for the others.
template <typename Visit>
void for_each_possible_pixel(const Intrinsics& camera, const Vector3d& p, Visit&& visit) {
  if (p.z() < 1e-6) return visit(-1, -1);
  const double s = p.x() * camera.fx / p.z() + camera.cx, t = p.y() * camera.fy / p.z() + camera.cy;
  const double off = 1e-4 + 4e-6 / p.z() * (camera.fx + camera.fy) * (1 + p.norm() / p.z());
  for (const double ds : {-off, off})
    for (const double dt : {-off, off}) {
      const double column = std::floor(s + ds + 0.5), row = std::floor(t + dt + 0.5);
      const bool inside = column >= 1 && row >= 1 && column <= camera.width - 2 && row <= camera.height - 2;
      visit(inside ? static_cast<int>(column) : -1, inside ? static_cast<int>(row) : -1);
    }
}

/// What is the same for all, else open.
Truth merged(std::optional<Truth>& all, Truth next) {
  if (!all) all = next;
  if (*all != next) all = Truth::open;
  return *all;
}

/// The numbers of a pixel.
struct Surface {
  Vector3d p_world;
  double support_margin, weak_margin, strong_margin, noise, voxel;  ///< [m]
};

/// Does a frame look at the surface, and does it measure it as well: between the nearest and the farthest of the 3 x 3 depths there, but
/// for a margin?
struct Support {
  Truth looks, supports;
};
Support supports(const SeenView& frame, const Surface& surface) {
  const Vector3d q = frame.T_world_camera.inverse() * surface.p_world;
  std::optional<Truth> all, looks;
  for_each_possible_pixel(frame.image.intrinsics, q, [&](int s, int t) {
    double nearest = 1e9, farthest = 0;
    for (int n = 0; n < 9 && s >= 0; ++n) {
      const double d = frame.image.depth[(t + n / 3 - 1) * frame.image.intrinsics.width + s + n % 3 - 1];
      if (d <= 0) continue;  // no surface
      nearest = std::min(nearest, d);
      farthest = std::max(farthest, d);
    }
    merged(looks, truth(s >= 0));
    merged(all, s < 0 ? Truth::no
                      : !less(q.z(), nearest - surface.support_margin, kTolerance) &&
                            !less(farthest + surface.support_margin, q.z(), kTolerance));
  });
  return {*looks, *all};
}

/// What a kept view says of a surface.
struct Opinion {
  std::optional<Truth> agrees, weak, strong;  ///< weak, strong: it contradicts by such a margin
  bool open() const { return *agrees == Truth::open || *weak == Truth::open || *strong == Truth::open; }
};

/// A view contradicts if it has seen farther in all 3 x 3 pixels, and agrees if it has seen as far in its pixel, and no farther. If only
/// some of the pixels have seen farther it says nothing.
Opinion opinion(const SeenView& view, const Surface& surface) {
  const Vector3d q = view.T_world_camera.inverse() * surface.p_world;
  Opinion all;
  for_each_possible_pixel(view.image.intrinsics, q, [&](int s, int t) {
    Truth agrees = Truth::no, weak = Truth::no, strong = Truth::no;
    const auto depth = [&](int n) {
      const float d = view.image.depth[(t + n / 3 - 1) * view.image.intrinsics.width + s + n % 3 - 1];
      return kept_steps(d, view.depth_step) * view.depth_step;
    };
    if (s >= 0 && depth(4) > 0) {
      const double seen = depth(4);
      double smallest = seen;
      for (int n = 0; n < 9; ++n) smallest = std::min(smallest, depth(n));
      const Truth middle = less(q.z() + surface.weak_margin, seen, kTolerance);
      weak = less(q.z() + surface.weak_margin, smallest, kTolerance);
      strong = middle == Truth::yes ? weak && less(q.z() + surface.strong_margin, smallest, kTolerance) : Truth::no;
      agrees = middle == Truth::no ? less(std::abs(seen - q.z()), surface.support_margin, kTolerance) : Truth::no;
      if (middle == Truth::open || weak == Truth::open) agrees = Truth::open;
    }
    merged(all.agrees, agrees);
    merged(all.weak, weak);
    merged(all.strong, strong);
  });
  return all;
}

/// The least and the most evidence that float may find.
struct Evidence {
  int least = NO_EVIDENCE, most = NO_EVIDENCE;
  bool open() const { return least != most; }
  Truth at_least(int evidence) const { return least >= evidence ? Truth::yes : most < evidence ? Truth::no : Truth::open; }
};

/// How often the interesting cases decided.
struct Tally {
  std::size_t weak = 0, strong = 0, by_seen = 0, old_surfaces = 0, taken_already = 0, enough_opinions = 0, chosen = 0, left_out = 0,
              updates = 0, many_views = 0;
};

struct Witnesses {
  TakeBackLimits limits;
  const Nuvg& grid;
  const SeenView& now;
  const std::deque<SeenView>& last;
  std::vector<SeenView> older;
  SeenBits seen, taken;
};

Surface surface_of(const Witnesses& w, int s, int t) {
  const Intrinsics& camera = w.now.image.intrinsics;
  const double d = w.now.image.depth[t * camera.width + s], voxel = w.grid.voxel_size(d);
  const double noise = 3 * (w.limits.noise + w.limits.noise_growth * d * d) + w.limits.quantisation * d * d;
  const Vector3d p((s - camera.cx) / camera.fx * d, (t - camera.cy) / camera.fy * d, d);
  return {w.now.T_world_camera * p,
          w.limits.support_margin * voxel + noise,
          std::max(w.limits.weak_margin * voxel, noise),
          std::max(w.limits.strong_margin * voxel, noise),
          noise,
          voxel};
}

/// The point that is `distance` behind a surface, as the camera sees it.
Vector3d behind(const Witnesses& w, const Surface& surface, double distance) {
  const Vector3d from = w.now.T_world_camera.translation();
  return surface.p_world + distance * (surface.p_world - from).normalized();
}

/// Was the space around a surface seen before: at it, behind it, and beside it along the axes of the image?
Truth deep_in_seen_space(const Witnesses& w, const Surface& surface, double margin) {
  Truth deep = is_among(w.seen, surface.p_world) && is_among(w.seen, behind(w, surface, margin));
  for (const double step : {margin, -margin})
    for (const int axis : {0, 1}) deep = deep && is_among(w.seen, surface.p_world + step * w.now.T_world_camera.linear().col(axis));
  return deep;
}

Evidence evidence_of(const Witnesses& w, int s, int t, Tally& tally) {
  if (!(w.now.image.depth[t * w.now.image.intrinsics.width + s] > 0)) return {};
  const Surface surface = surface_of(w, s, t);
  int supporting = 0, undecided = 0, looking = 0, may_look = 0;
  for (const SeenView& frame : w.last) {
    const auto [looks, support] = supports(frame, surface);
    supporting += support == Truth::yes;
    undecided += support == Truth::open;
    looking += looks == Truth::yes;
    may_look += looks != Truth::no;
  }
  if (supporting + undecided < w.limits.weak_supports) return {};
  const Truth is_taken = is_among(w.taken, behind(w, surface, 0.5 * w.limits.reach * surface.voxel));
  const Truth asked = truth(supporting >= w.limits.weak_supports) && !is_taken;

  int weak = 0, strong = 0, agree = 0, newer = 0;
  std::size_t views = 0;
  for (const SeenView& view : w.older) {
    tally.many_views += ++views == 17;  // more than a team of work items asks at once
    if (weak + agree >= w.limits.opinions || newer >= w.limits.newer_opinions) {
      ++tally.enough_opinions;
      break;
    }
    const Opinion says = opinion(view, surface);
    if (says.open()) return {NO_EVIDENCE, is_taken == Truth::yes ? NO_EVIDENCE : STRONG_EVIDENCE};
    (weak == 0 ? newer : agree) += says.agrees == Truth::yes;
    weak += says.weak == Truth::yes;
    strong += says.strong == Truth::yes;
  }
  const Truth weak_by_seen = truth(2 * (agree + newer) <= w.limits.contradictions) && deep_in_seen_space(w, surface, surface.weak_margin),
              strong_by_seen = weak_by_seen && deep_in_seen_space(w, surface, surface.strong_margin);
  // With seen points that contradict weakly, or strongly, or not at all.
  const auto found = [&](bool seen_weakly, bool seen_strongly) {
    const int most = w.limits.contradictions, all = seen_weakly ? std::max(weak, most) : weak;
    if (all < most || all < 2 * agree) return NO_EVIDENCE;
    return (seen_strongly ? std::max(strong, most) : strong) >= most ? STRONG_EVIDENCE : WEAK_EVIDENCE;
  };
  Evidence evidence = {STRONG_EVIDENCE, NO_EVIDENCE};
  for (const bool by_weak : {false, true})
    for (const bool by_strong : {false, true}) {
      if (weak_by_seen == truth(!by_weak) || strong_by_seen == truth(!by_strong)) continue;
      evidence.least = std::min(evidence.least, found(by_weak, by_strong));
      evidence.most = std::max(evidence.most, found(by_weak, by_strong));
    }
  if (LAST_FRAMES * supporting < w.limits.strong_supports * may_look) evidence.least = std::min(evidence.least, WEAK_EVIDENCE);
  if (LAST_FRAMES * (supporting + undecided) < w.limits.strong_supports * looking) evidence.most = std::min(evidence.most, WEAK_EVIDENCE);
  tally.taken_already += supporting >= w.limits.weak_supports && is_taken == Truth::yes && evidence.least > NO_EVIDENCE;
  if (asked != Truth::yes) evidence.least = NO_EVIDENCE;
  if (asked == Truth::no) evidence.most = NO_EVIDENCE;
  tally.old_surfaces += asked == Truth::yes && weak >= w.limits.contradictions && weak < 2 * agree;
  tally.by_seen += evidence.least > found(false, false);
  return evidence;
}

/// The pixels that take space back: with evidence, and near the middle of a square in which all have strong evidence.
std::vector<char> chosen_of(const std::vector<int>& evidence, int width, int height) {
  const auto is_square = [&](int s, int t) {
    const int half = TAKE_SQUARE / 2;
    if (s < half || t < half || s + half >= width || t + half >= height) return false;
    bool square = true;
    for (int v = t - half; v <= t + half; ++v)
      for (int u = s - half; u <= s + half; ++u) square = square && evidence[v * width + u] == STRONG_EVIDENCE;
    return square;
  };
  std::vector<char> squares, chosen;
  for (int n = 0; n < width * height; ++n) squares.push_back(is_square(n % width, n / width));
  for (int n = 0; n < width * height; ++n) {
    bool near = false;
    for (int m = 0; m < width * height; ++m)
      if (std::abs(m % width - n % width) <= TAKE_GROWTH && std::abs(m / width - n / width) <= TAKE_GROWTH) near = near || squares[m];
    chosen.push_back(near && evidence[n] != NO_EVIDENCE);
  }
  return chosen;
}

/// Evidence is promised near pixels of every TAKE_SQUARE-th column and row with strong evidence. Elsewhere it may be left out.
void expect_evidence(const std::vector<Evidence>& expected, int width, int height, const TakingBackFixture& fixture, std::size_t count,
                     Tally& tally) {
  std::vector<Truth> near(expected.size(), Truth::no);
  Truth any = Truth::no;
  for (int t = 0; t < height; t += TAKE_SQUARE)
    for (int s = 0; s < width; s += TAKE_SQUARE) {
      const Truth strong = expected[t * width + s].at_least(STRONG_EVIDENCE);
      any = any || strong;
      const int reach = TAKE_SQUARE / 2 + TAKE_GROWTH;
      for (int n = 0; n < width * height; ++n)
        if (std::abs(n % width - s) <= reach && std::abs(n / width - t) <= reach) near[n] = near[n] || strong;
    }
  if (any == Truth::no) {
    EXPECT_EQ(count, 0u);
  }
  if (any != Truth::yes) return;
  ++tally.updates;
  const std::vector<cl_uchar> evidence = fixture.taking.evidence().read(expected.size()),
                              chosen = fixture.taking.chosen().read(expected.size());
  std::vector<int> decided;  // what float has found where it decides: a single pixel may decide about many squares
  for (std::size_t n = 0; n < expected.size(); ++n) decided.push_back(std::clamp<int>(evidence[n], expected[n].least, expected[n].most));
  const std::vector<char> expected_chosen = chosen_of(decided, width, height);
  Comparison weak("weak evidence"), strong("strong evidence"), taking("chosen");
  for (std::size_t n = 0; n < expected.size(); ++n) {
    const auto place = [&] { return "column " + std::to_string(n % width) + ", row " + std::to_string(n / width); };
    ASSERT_LE(evidence[n], STRONG_EVIDENCE);
    ASSERT_LE(chosen[n], 1);
    taking.add(truth(expected_chosen[n]), chosen[n] != 0, place);
    tally.chosen += expected_chosen[n];
    tally.left_out += !expected_chosen[n] && decided[n] != NO_EVIDENCE;
    if (evidence[n] == NO_EVIDENCE && near[n] != Truth::yes) continue;
    weak.add(expected[n].at_least(WEAK_EVIDENCE), evidence[n] >= WEAK_EVIDENCE, place);
    strong.add(expected[n].at_least(STRONG_EVIDENCE), evidence[n] == STRONG_EVIDENCE, place);
    tally.weak += evidence[n] == WEAK_EVIDENCE;
    tally.strong += evidence[n] == STRONG_EVIDENCE;
  }
  EXPECT_EQ(static_cast<std::size_t>(std::count(chosen.begin(), chosen.end(), 1)), count);
}

struct Setup {
  double seen = 0;   ///< share of the lattice's bricks that are full of seen points
  double taken = 0;  ///< of taken points
  double noise_growth = 0.0015;
  const CameraSetup* others = nullptr;  ///< another camera, whose frames are between this camera's
  int kept = 100;
  std::pair<int, int> before = {5, 14};  ///< least and largest number of frames before something is put down
  double motion = 0;                     ///< of the camera between frames [m]; 0: random
};

void check(CameraSetup camera, unsigned seed, const Setup& setup, Tally& tally) {
  SCOPED_TRACE(camera.name + ", seed " + std::to_string(seed) + ", seen " + std::to_string(setup.seen) + ", taken " +
               std::to_string(setup.taken) + ", noise " + std::to_string(setup.noise_growth));
  camera.config.noise = 0.001;
  camera.config.noise_growth = setup.noise_growth;
  camera.config.recent_views = setup.kept;
  Random random(seed);
  TakingBackFixture fixture(camera.config);
  TwoScenes scenes = random_scenes(camera, random);
  if (setup.motion > 0) scenes.motion = setup.motion;
  play(fixture, scenes, camera, random, setup.others, setup.before);
  const MapWindow& window = fixture.map().window();
  if (setup.seen > 0) fill_lattice(fixture.seen(), window, setup.seen, 0.05, random);
  if (setup.taken > 0) fill_lattice(fixture.taking.taken(), window, setup.taken, 0.05, random);
  fixture.open_window();
  const Nuvg grid(camera.intrinsics, camera.config);
  const Witnesses witnesses = {make_take_back_limits(camera.config),
                               grid,
                               fixture.now,
                               fixture.last,
                               fixture.older(),
                               bits_in_window(fixture.seen(), window),
                               bits_in_window(fixture.taking.taken(), window)};
  const int width = camera.intrinsics.width, height = camera.intrinsics.height;
  std::vector<Evidence> expected;
  for (int n = 0; n < width * height; ++n) expected.push_back(evidence_of(witnesses, n % width, n / width, tally));
  expect_evidence(expected, width, height, fixture, fixture.update(), tally);
}

/// Cameras of awkward sizes, and those of which squares fill a larger part.
std::vector<CameraSetup> all_cameras() {
  std::vector<CameraSetup> all = cameras();
  all.push_back(make_camera(23, 17, 20.3, 21.1, 65));
  if (!small_tests()) all.push_back(make_camera(41, 30, 38.3, 39.1, 130));
  return all;
}

const unsigned kSeeds = small_tests() ? 2 : 8;

TEST(StageEvidence, KeptViewsContradict) {
  Tally tally;
  for (const CameraSetup& camera : all_cameras())
    for (unsigned seed = 0; seed < kSeeds; ++seed) check(camera, seed, {}, tally);
  if (small_tests()) return;
  EXPECT_GT(tally.updates, 10u);
  for (const std::size_t count : {tally.weak, tally.strong, tally.old_surfaces, tally.enough_opinions, tally.chosen, tally.left_out})
    EXPECT_GT(count, 100u) << "nothing was tested";
}

/// Where the sensor's noise is wider than voxels, it decides what is a contradiction.
TEST(StageEvidence, NoisySensor) {
  Tally tally;
  for (const CameraSetup& camera : all_cameras())
    for (unsigned seed = 20; seed < 20 + kSeeds; ++seed) check(camera, seed, {0, 0, seed % 2 == 0 ? 0.02 : 0.06}, tally);
  EXPECT_TRUE((tally.weak > 100 && tally.strong > 100 && tally.chosen > 100) || small_tests()) << "nothing was tested";
}

TEST(StageEvidence, SeenPointsContradict) {
  Tally tally;
  for (const CameraSetup& camera : all_cameras())
    for (unsigned seed = 40; seed < 40 + kSeeds; ++seed) check(camera, seed, {seed % 2 == 0 ? 0.6 : 1, 0, 0.0015, nullptr, 2}, tally);
  EXPECT_TRUE((tally.by_seen > 100 && tally.chosen > 100) || small_tests()) << "nothing was tested";
}

TEST(StageEvidence, WhatIsTakenAlreadyIsNotTakenAgain) {
  Tally tally;
  for (const CameraSetup& camera : all_cameras())
    for (unsigned seed = 60; seed < 60 + kSeeds; ++seed) check(camera, seed, {seed % 3 == 0 ? 0.7 : 0, 0.3}, tally);
  EXPECT_TRUE((tally.taken_already > 100 && tally.strong > 100) || small_tests()) << "nothing was tested";
}

/// Images of another size lie between this camera's. A larger one than before makes the last frames be forgotten.
TEST(StageEvidence, CamerasThatTakeTurns) {
  Tally tally;
  CameraSetup small = make_camera(23, 17, 20.3, 21.1, 65), large = make_camera(33, 24, 26.7, 27.1, 65);
  large.config.z_max = small.config.z_max;
  for (unsigned seed = 80; seed < 80 + 2 * kSeeds; ++seed) {
    check(small, seed, {0, 0, 0.0015, &large}, tally);
    check(large, seed, {0, 0, 0.0015, &small}, tally);
  }
  EXPECT_TRUE((tally.strong > 100 && tally.chosen > 100) || small_tests()) << "nothing was tested";
}

/// The camera moves so far that many views do not have a surface: others are asked until enough have an opinion.
TEST(StageEvidence, ManyViewsAreAsked) {
  Tally tally;
  for (const CameraSetup& camera : all_cameras())
    for (unsigned seed = 100; seed < 100 + kSeeds; ++seed) check(camera, seed, {0, 0, 0.0015, nullptr, 100, {40, 60}, 0.3}, tally);
  EXPECT_TRUE((tally.many_views > 100 && tally.strong > 100) || small_tests())
      << "nothing was tested: " << tally.many_views << ", " << tally.strong;
}

TEST(StageEvidence, NothingMeasured) {
  CameraSetup camera = make_camera(23, 17, 20.3, 21.1, 65);
  Random random(1);
  for (const bool ever : {true, false}) {
    TakingBackFixture fixture(camera.config);
    const TwoScenes scenes = random_scenes(camera, random);
    for (int n = 0; n < 20; ++n) {
      if (ever)
        fixture.start(scenes, n > 10, camera, random);
      else
        fixture.start(random_image(camera, Content::all_invalid, random), scenes.T_world_scene, camera.config.z_max);
      if (n < 19) fixture.end(true);
    }
    fixture.start(random_image(camera, Content::all_invalid, random), scenes.T_world_scene, camera.config.z_max);
    EXPECT_EQ(fixture.update(), 0u);
    EXPECT_TRUE(fixture.taking.taken().empty());
  }
}

}  // namespace
}  // namespace frontier_surfels
