/// TakingBack and kernels/stages/3_taking_back.cl: which points of the lattice are taken back and given back, compared with asking about
/// every point of the window, and what is left of bricks.

#include <gtest/gtest.h>

#include "stages/lattice_input.hpp"
#include "stages/taking_back_fixture.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// Does a point of the camera's frame lie at the surface of a chosen pixel, or at most `reach` voxels behind it?
/// @param chosen  empty: no pixel is chosen
Truth behind_chosen(const SeenView& view, const Nuvg& grid, double reach, const std::vector<cl_uchar>& chosen, const Vector3d& p) {
  if (chosen.empty() || p.z() <= 0) return Truth::no;
  const Intrinsics& camera = view.image.intrinsics;
  const double s = p.x() * camera.fx / p.z() + camera.cx, t = p.y() * camera.fy / p.z() + camera.cy;
  if (!(std::abs(s - 0.5 * camera.width) < camera.width && std::abs(t - 0.5 * camera.height) < camera.height)) return Truth::no;
  const double off = 1e-4 + 4e-6 / p.z() * (camera.fx + camera.fy) * (1 + p.norm() / p.z());  // what float may be wrong by
  bool yes = false, no = false;
  for (const double ds : {-off, off})
    for (const double dt : {-off, off}) {
      const double column = std::floor(s + ds + 0.5), row = std::floor(t + dt + 0.5);
      Truth behind = Truth::no;
      if (column >= 0 && row >= 0 && column < camera.width && row < camera.height) {
        const auto pixel = static_cast<std::size_t>(row * camera.width + column);
        const double d = view.image.depth[pixel];
        if (chosen[pixel]) behind = !less(p.z(), d, 1e-5) && !less(d + reach * grid.voxel_size(d), p.z(), 1e-5);
      }
      yes = yes || behind != Truth::no;
      no = no || behind != Truth::yes;
    }
  return yes && no ? Truth::open : truth(yes);
}

struct Tally {
  std::size_t set = 0, cleared = 0, stayed = 0, updates_that_chose = 0, updates_that_did_not = 0;
};

/// Runs the update, and expects that just the right points of the window are taken after it, and no other ones have changed.
/// @param stride  only every so many-th point along z is looked at
/// @return number of chosen pixels
std::size_t check_update(TakingBackFixture& fixture, const CameraSetup& camera, Tally& tally, int stride = 1) {
  SeenPoints& taken = fixture.taking.taken();
  const SeenBits before(taken.saved());
  const std::size_t count = fixture.update();
  std::vector<cl_uchar> chosen;
  if (count > 0) chosen = fixture.taking.chosen().read(fixture.now.image.depth.size());
  ++(count > 0 ? tally.updates_that_chose : tally.updates_that_did_not);
  const SeenBits after(taken.saved());

  const Nuvg grid(camera.intrinsics, camera.config);
  const double reach = make_take_back_limits(camera.config).reach;
  const MapWindow& window = fixture.map().window();
  const Eigen::Isometry3d T_camera_world = fixture.now.T_world_camera.inverse();
  bool any = false;
  {
    Comparison comparison("taken");
    const int n = after.points();
    for (int cell = 0; cell < window.cells(); ++cell) {
      const BlockKey block = window.block(cell);
      const bool had = before.blocks().count(block) != 0, has = after.blocks().count(block) != 0;
      if (!had && !has && chosen.empty()) continue;
      for (int z = block.z * n; z < (block.z + 1) * n; z += stride)
        for (int y = block.y * n; y < (block.y + 1) * n; ++y)
          for (int x = block.x * n; x < (block.x + 1) * n; ++x) {
            const Vector3d p = T_camera_world * ((Eigen::Array3d(x, y, z) + 0.5).matrix() * after.spacing());
            const bool was = had && before.seen(x, y, z), is = has && after.seen(x, y, z);
            const Truth behind = was ? Truth::no : behind_chosen(fixture.now, grid, reach, chosen, p);
            any = any || is;
            if (!was && behind == Truth::no && !is) continue;  // most of them: they would hide how many are undecided
            comparison.add((truth(was) || behind) && !camera_knows(fixture.now, p), is,
                           [&] { return "point " + std::to_string(x) + ", " + std::to_string(y) + ", " + std::to_string(z); });
            tally.set += is && !was;
            tally.cleared += was && !is;
            tally.stayed += was && is;
          }
    }
  }
  if (stride == 1) {
    EXPECT_TRUE(fixture.told.has_taken != 0 || !any);
    EXPECT_TRUE(fixture.told.has_taken == 0 || any || !fixture.asked_first);
  }
  return count;
}

/// Expects that no words are kept for bricks that are uniform.
void expect_no_spare_bricks(SeenPoints& taken) {
  std::size_t mixed = 0;
  const auto bricks = static_cast<std::size_t>(taken.bricks_of_block());
  for (const SeenSpace::Block& block : taken.saved().blocks)
    for (std::size_t brick = 0, with_words = 0; brick < bricks; ++brick) {
      if (block.bytes[brick] != SEEN_MIXED) continue;
      const auto begin = block.bytes.begin() + static_cast<std::ptrdiff_t>(bricks + kBrickBytes * with_words++);
      const auto is = [&](std::uint8_t byte) { return std::all_of(begin, begin + kBrickBytes, [&](std::uint8_t b) { return b == byte; }); };
      EXPECT_FALSE(is(0) || is(255));
      ++mixed;
    }
  EXPECT_EQ(taken.bricks(), mixed);
}

std::vector<CameraSetup> some_cameras() {
  if (small_tests()) return {make_camera(23, 17, 20.3, 21.1, 65)};
  return {make_camera(23, 17, 20.3, 21.1, 65), make_camera(41, 30, 38.3, 39.1, 130), make_camera(7, 9, 17.7, 18.1, 60), cameras().front()};
}

TEST(StageTakingBack, PointsBehindChosenPixelsAreTaken) {
  Tally tally;
  for (const CameraSetup& camera : some_cameras())
    for (unsigned seed = 0; seed < 4; ++seed) {
      SCOPED_TRACE(camera.name + ", seed " + std::to_string(seed));
      Random random(seed);
      TakingBackFixture fixture(camera.config);
      play(fixture, random_scenes(camera, random), camera, random);
      check_update(fixture, camera, tally, seed % 2 == 0 ? 1 : 3);
      expect_no_spare_bricks(fixture.taking.taken());
      if (tally.set == 0) {
        EXPECT_TRUE(fixture.taking.taken().blocks_with_points().empty());
      }
    }
  EXPECT_GT(tally.updates_that_chose, small_tests() ? 0u : 2u);
  EXPECT_TRUE(tally.updates_that_did_not > 0 || small_tests());
  EXPECT_GT(tally.set, 1000u);
}

TEST(StageTakingBack, ForEveryDistanceOfThePoints) {
  Tally tally;
  const CameraSetup camera = make_camera(23, 17, 20.3, 21.1, 65);
  for (const double spacing : {0.02, 0.01}) {
    Random random(1);
    TakingBackFixture fixture(camera.config);
    fixture.seen().choose_spacing(spacing);
    play(fixture, random_scenes(camera, random), camera, random);
    check_update(fixture, camera, tally, small_tests() ? 61 : spacing < 0.02 ? 23 : 7);
    EXPECT_EQ(fixture.taking.taken().shift(), fixture.told.seen_shift);
    expect_no_spare_bricks(fixture.taking.taken());
  }
  EXPECT_EQ(tally.updates_that_chose, 2u);
  EXPECT_GT(tally.set, 1000u);
}

/// Bricks of every kind, and a block beyond the window.
TEST(StageTakingBack, PointsTakenBefore) {
  Tally tally;
  for (const CameraSetup& camera : some_cameras())
    for (unsigned seed = 10; seed < 12; ++seed) {
      SCOPED_TRACE(camera.name + ", seed " + std::to_string(seed));
      Random random(seed);
      TakingBackFixture fixture(camera.config);
      play(fixture, random_scenes(camera, random), camera, random);
      SeenPoints& taken = fixture.taking.taken();
      const MapWindow& window = fixture.map().window();
      fill_lattice(taken, window, 0.2, 0.2, random);
      const BlockKey key = window.block(0), beyond = {key.x - 100, key.y, key.z};
      SeenBlockBytes bytes;
      for (int brick = 0; brick < taken.bricks_of_block(); ++brick) bytes.add_points([&](int) { return random.chance(0.5); });
      const SeenBlock far_away = {beyond, bytes.take()};
      taken.add_blocks({far_away});
      fixture.open_window();
      check_update(fixture, camera, tally, seed % 2 == 0 ? 1 : 3);
      expect_no_spare_bricks(taken);
      EXPECT_EQ(taken.read_blocks({beyond}).front(), far_away.second);
    }
  EXPECT_GT(tally.set, 500u);
  EXPECT_GT(tally.cleared, 1000u);
  EXPECT_GT(tally.stayed, 1000u);
}

/// Whether the host waits for the answer at once or later, the same points are taken, with bricks of every kind.
TEST(StageTakingBack, WhenTheHostAsksDoesNotMatter) {
  std::size_t with_chosen = 0, without = 0;
  for (const CameraSetup& camera : some_cameras())
    for (unsigned seed = 0; seed < 6; ++seed) {
      SCOPED_TRACE(camera.name + ", seed " + std::to_string(seed));
      std::vector<std::size_t> counts[2];
      std::vector<SeenSpace> saved[2];
      std::vector<BlockKey> changed[2];
      for (const bool ask_first : {false, true}) {
        Random random(seed);
        TakingBackFixture fixture(camera.config);
        const TwoScenes scenes = random_scenes(camera, random);
        play(fixture, scenes, camera, random);
        SeenPoints& taken = fixture.taking.taken();
        const double share = seed % 2 == 0 ? 0.2 : 0.02;  // where much is taken, nothing more is
        fill_lattice(taken, fixture.map().window(), share, share, random);
        fixture.open_window();
        for (int frame = 0; frame < 3; ++frame) {
          if (frame > 0) fixture.start(scenes, frame == 1, camera, random);
          counts[ask_first].push_back(fixture.update(ask_first));
          saved[ask_first].push_back(taken.saved());
          expect_no_spare_bricks(taken);
          fixture.end(false);
        }
        changed[ask_first] = fixture.taking.take_changed();
        std::sort(changed[ask_first].begin(), changed[ask_first].end());
        changed[ask_first].erase(std::unique(changed[ask_first].begin(), changed[ask_first].end()), changed[ask_first].end());
      }
      EXPECT_EQ(counts[0], counts[1]);
      EXPECT_EQ(changed[0], changed[1]);
      for (std::size_t frame = 0; frame < saved[0].size(); ++frame) {
        ASSERT_EQ(saved[0][frame].blocks.size(), saved[1][frame].blocks.size());
        for (std::size_t n = 0; n < saved[0][frame].blocks.size(); ++n)
          EXPECT_EQ(saved[0][frame].blocks[n].bytes, saved[1][frame].blocks[n].bytes);
        ++(counts[0][frame] > 0 ? with_chosen : without);
      }
    }
  EXPECT_TRUE((with_chosen > 2 && without > 2) || small_tests()) << "nothing was tested";
}

/// A board before a wall: all that is taken behind it lies before the wall.
TwoScenes board_before_wall(const CameraSetup& camera) {
  const Eigen::AlignedBox2d everywhere(Eigen::Vector2d(-50, -50), Eigen::Vector2d(50, 50)),
      board(Eigen::Vector2d(-0.45, -0.35), Eigen::Vector2d(0.35, 0.4));
  TwoScenes scenes;
  scenes.before = scenes.after = {{0.97 * camera.config.z_max, 0, 0, everywhere}};
  scenes.after.push_back({1, 0, 0, board});
  scenes.noise = 0.001;
  scenes.holes = 0;
  scenes.T_world_scene = Random(4).pose(2, 3);
  scenes.motion = 0.01;
  return scenes;
}

struct BoardTest : testing::Test {
  explicit BoardTest(const Config& config = make_camera(23, 17, 20.3, 21.1, 65).config) : fixture(config) {}

  /// @return chosen pixels of the last frame
  std::size_t frames(int count, bool with_board, bool checked = true) {
    std::size_t chosen = 0;
    for (int n = 0; n < count; ++n) {
      fixture.start(scenes, with_board, camera, random);
      chosen = checked ? check_update(fixture, camera, tally) : fixture.update();
      fixture.end(!with_board);  // views that agree with the board would make it an old surface
    }
    return chosen;
  }

  const CameraSetup camera = make_camera(23, 17, 20.3, 21.1, 65);
  const TwoScenes scenes = board_before_wall(camera);
  Random random{3};
  Tally tally;
  TakingBackFixture fixture;
};

/// With strong_supports frames before it that have measured the board, a frame takes space back; not earlier.
TEST_F(BoardTest, EnoughOfTheLastFramesMustSupport) {
  const TakeBackLimits limits = make_take_back_limits(camera.config);
  frames(12, false);
  EXPECT_EQ(frames(limits.strong_supports, true), 0u);
  EXPECT_EQ(tally.set, 0u);
  EXPECT_GT(frames(1, true), 20u);
  EXPECT_GT(tally.set, 100u);
}

/// As after a failure of the device.
TEST_F(BoardTest, TheSameFrameAgainTakesNothingMore) {
  frames(12, false, false);
  frames(5, true, false);
  fixture.start(scenes, true, camera, random);
  const std::size_t pixels = fixture.update();
  EXPECT_GT(pixels, 20u);
  const SeenSpace once = fixture.taking.taken().saved();
  for (int n = 0; n < 2; ++n) {
    EXPECT_EQ(fixture.update(), pixels) << "they count as long as the frame has not ended";
    const SeenSpace again = fixture.taking.taken().saved();
    ASSERT_EQ(again.blocks.size(), once.blocks.size());
    for (std::size_t m = 0; m < once.blocks.size(); ++m) EXPECT_EQ(again.blocks[m].bytes, once.blocks[m].bytes);
    EXPECT_NE(fixture.told.has_taken, 0);
  }
}

/// Once the board is gone, frames see what was taken: bricks become empty, and none is kept.
TEST_F(BoardTest, BricksThatBecomeEmptyAreFreed) {
  SeenPoints& taken = fixture.taking.taken();
  frames(12, false, false);
  EXPECT_EQ(taken.bricks(), 0u);
  EXPECT_EQ(fixture.told.has_taken, 0);
  frames(6, true, false);
  EXPECT_GT(taken.bricks(), 0u);
  EXPECT_NE(fixture.told.has_taken, 0);
  const std::size_t bytes = taken.bytes();
  EXPECT_EQ(frames(3, false), 0u);
  EXPECT_GT(tally.cleared, 100u);
  EXPECT_EQ(taken.bricks(), 0u);
  EXPECT_TRUE(taken.blocks_with_points().empty());
  EXPECT_EQ(fixture.told.has_taken, 0);
  // The same again needs little more memory: bricks that became free are used.
  frames(6, true, false);
  EXPECT_GT(taken.bricks(), 0u);
  EXPECT_LE(taken.bytes(), bytes + bytes / 4);
}

TEST_F(BoardTest, ClearForgetsPointsAndFrames) {
  frames(12, false, false);
  frames(6, true, false);
  EXPECT_FALSE(fixture.taking.taken().empty());
  fixture.taking.clear();
  fixture.last.clear();
  EXPECT_TRUE(fixture.taking.taken().empty());
  const TakeBackLimits limits = make_take_back_limits(camera.config);
  // Of the frames that look there now, all support it: weak_supports are enough.
  EXPECT_EQ(frames(limits.weak_supports, true), 0u) << "frames from before count";
  EXPECT_EQ(fixture.told.has_taken, 0);
  EXPECT_GT(frames(1, true), 20u) << "kept views must still contradict";
}

/// As long as no view was forgotten, the lattice of the seen points may still change, with a camera of other voxels for example. Kernels
/// look up both with one shift, so the taken points must follow.
TEST_F(BoardTest, TheLatticeIsThatOfTheSeenPoints) {
  frames(12, false, false);
  frames(6, true, false);
  ASSERT_FALSE(fixture.taking.taken().empty());
  ASSERT_TRUE(fixture.seen().empty());
  fixture.seen().choose_spacing(fixture.seen().spacing() / 4);
  fixture.start(scenes, true, camera, random);
  EXPECT_EQ(fixture.taking.taken().shift(), fixture.frame().seen_shift);
}

/// Two cameras that look to different sides by turns: only half of the last frames look at a surface.
TEST_F(BoardTest, CamerasThatLookToDifferentSides) {
  std::size_t chosen = 0;
  for (int n = 0; n < 24; ++n) {
    fixture.start(scenes, n >= 12, camera, random);
    chosen += fixture.update();
    fixture.end(n < 12);
    const Eigen::Isometry3d T_back(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()));
    fixture.start(random_image(camera, Content::all_valid, random), scenes.T_world_scene * T_back, camera.config.z_max);
    fixture.update();
    fixture.end(true);
  }
  EXPECT_GT(chosen, 0u);
}

TEST_F(BoardTest, NothingHappensWhereItIsSwitchedOff) {
  for (const bool take_back : {false, true}) {
    Config config = camera.config;
    config.take_back = take_back;
    config.seen_points = !take_back;
    TakingBackFixture off(config);
    for (int n = 0; n < 20; ++n) {
      off.start(scenes, n >= 12, camera, random);
      EXPECT_EQ(off.update(), 0u);
      EXPECT_EQ(off.told.has_taken, 0);
      off.end(true);
    }
    EXPECT_TRUE(off.taking.taken().empty());
  }
}

}  // namespace
}  // namespace frontier_surfels
