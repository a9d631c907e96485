/// Seen points and their kernels: what a view sets is compared with the exact test of every point of the lattice, and what a point is told
/// with the sum over the eight points around it.

#include <gtest/gtest.h>

#include "map/seen_block.hpp"
#include "opencl/fault_injection.hpp"
#include "stages/frame_fixture.hpp"
#include "stages/reference_views.hpp"
#include "stages/remembering.hpp"
#include "stages/seen_bits.hpp"
#include "stages/view_settling.hpp"
#include "storage/map_archive.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// Walls that hide what is behind them, with holes, so that whole bricks are seen, hidden, or both.
WorkingImage wall_image(const CameraSetup& camera, Random& random) {
  WorkingImage image = random_image(camera, Content::all_invalid, random);
  const double distance = random.uniform(0.5 * camera.config.z_max, camera.config.z_max), hole = random.chance(0.5) ? 0.02 : 0;
  for (float& d : image.depth)
    if (!random.chance(hole)) d = static_cast<float>(distance * random.uniform(0.97, 1.0));
  return image;
}

class SeenPointsTest : public testing::Test {
 protected:
  /// @param spacing  wanted distance of the lattice's points [m]
  void remember(const CameraSetup& setup, int views, double spacing, Content content, bool walls) {
    camera_ = setup;
    camera_.config.recent_views = 0;
    fixture_ = std::make_unique<FrameFixture>(camera_.config);
    remembering_ = std::make_unique<Remembering>(fixture_->commands());
    fixture_->seen().choose_spacing(spacing);
    T_world_start_ = random_.pose(2, 3);
    for (int n = 0; n < views; ++n) {
      views_.push_back({walls ? wall_image(camera_, random_) : random_image(camera_, content, random_),
                        T_world_start_ * random_.pose(0.3, 0.5), depth_step_for(camera_.config.z_max)});
      fixture_->views().set_current(views_.back().image, views_.back().T_world_camera);
      EXPECT_FALSE(fixture_->views().keep_current());
      if (fixture_->views().forgotten())
        remembering_->remember(*fixture_->views().forgotten(), fixture_->views(), fixture_->map().block_size(), fixture_->seen());
    }
  }

  /// Every point of the blocks that are remembered, and random points around.
  void expect_right_points() {
    const SeenBits bits(fixture_->seen().saved());
    std::size_t seen = 0, unseen = 0, open = 0;
    const auto check = [&](int x, int y, int z) {
      const Truth known = any_knows(views_, (Eigen::Array3d(x, y, z) + 0.5).matrix() * bits.spacing());
      const bool is_seen = bits.seen(x, y, z);
      ++(known == Truth::open ? open : is_seen ? seen : unseen);
      if (known != Truth::open) {
        ASSERT_EQ(is_seen, known == Truth::yes) << "point " << x << ", " << y << ", " << z;
      }
    };
    const int n = bits.points();
    for (const auto& [block, bytes] : bits.blocks())
      for (int z = 0; z < n; z += small_tests() ? 3 : 1)
        for (int y = 0; y < n; ++y)
          for (int x = 0; x < n; ++x) check(block.x * n + x, block.y * n + y, block.z * n + z);
    for (int m = 0; m < 20000; ++m) {
      const Eigen::Vector3d p = T_world_start_ * (random_.pose(1.5 * camera_.config.z_max, 0).translation()) / bits.spacing();
      check(static_cast<int>(p.x()), static_cast<int>(p.y()), static_cast<int>(p.z()));
    }
    EXPECT_GT(unseen, 0u);
    if (views_.front().image.depth.size() > 100) {
      EXPECT_GT(seen, 0u);
    }
    EXPECT_LT(open, 0.02 * static_cast<double>(seen + unseen) + 100);
  }

  Random random_{7};
  CameraSetup camera_ = cameras().front();
  std::unique_ptr<FrameFixture> fixture_;
  std::unique_ptr<Remembering> remembering_;
  std::vector<SeenView> views_;
  Eigen::Isometry3d T_world_start_ = Eigen::Isometry3d::Identity();
};

TEST_F(SeenPointsTest, AViewSetsThePointsThatItHasSeen) {
  for (const CameraSetup& camera : cameras())
    for (const bool walls : {true, false}) {
      SCOPED_TRACE(camera.name + (walls ? ", walls" : ", random depths"));
      views_.clear();
      remember(camera, 3, 0.02, Content::mixed, walls);
      expect_right_points();
    }
}

TEST_F(SeenPointsTest, ForEveryDistanceOfThePoints) {
  for (const double spacing : {0.04, 0.03, 0.01}) {
    SCOPED_TRACE(spacing);
    views_.clear();
    remember(cameras().front(), 2, spacing, Content::mixed, true);
    EXPECT_LE(fixture_->seen().spacing(), spacing);
    EXPECT_GT(fixture_->seen().spacing(), spacing / 2 - 1e-9);
    expect_right_points();
  }
}

TEST_F(SeenPointsTest, BricksWithPointsAreThoseOfTheTables) {
  const double block_size = FrameFixture(camera_.config).map().block_size();
  for (const int bricks_along : {1, 2, 4, 8, 16}) {
    SCOPED_TRACE(bricks_along);
    views_.clear();
    remember(cameras().front(), 1, block_size / (SEEN_BRICK * bricks_along), Content::mixed, true);
    SeenPoints& seen = fixture_->seen();
    ASSERT_EQ(1 << seen.shift(), bricks_along);
    seen.drop_block(seen.blocks().front());
    std::vector<BlockKey> blocks;
    for (const BlockKey& block : seen.blocks()) {
      std::vector<int> expected;
      for (int brick = 0; brick < seen.bricks_of_block(); ++brick)
        if (seen.entry(seen.table(block), brick) != SEEN_BRICK_EMPTY) expected.push_back(brick);
      EXPECT_EQ(seen.bricks_with_points(seen.table(block)), expected);
      EXPECT_EQ(seen.has_points(seen.table(block)), !expected.empty());
      if (!expected.empty()) blocks.push_back(block);
    }
    EXPECT_FALSE(blocks.empty());
    EXPECT_EQ(seen.blocks_with_points(), blocks);
  }
}

TEST_F(SeenPointsTest, AnEmptyViewIsNotRemembered) {
  remember(cameras().front(), 1, 0.02, Content::all_invalid, false);
  EXPECT_FALSE(fixture_->views().forgotten());
  EXPECT_TRUE(fixture_->seen().empty());
}

TEST_F(SeenPointsTest, TheSameViewAgainChangesNothing) {
  remember(cameras().front(), 1, 0.02, Content::mixed, true);
  const SeenSpace before = fixture_->seen().saved();
  const std::size_t bytes = fixture_->seen().bytes();
  for (int n = 0; n < 3; ++n)
    remembering_->remember(*fixture_->views().forgotten(), fixture_->views(), fixture_->map().block_size(), fixture_->seen());
  const SeenSpace after = fixture_->seen().saved();
  EXPECT_EQ(fixture_->seen().bytes(), bytes);
  ASSERT_EQ(after.blocks.size(), before.blocks.size());
  for (std::size_t n = 0; n < before.blocks.size(); ++n) EXPECT_EQ(after.blocks[n].bytes, before.blocks[n].bytes);
}

/// Whatever fails: whoever saves the changed blocks must hear of all of them.
TEST_F(SeenPointsTest, AfterAFailureTheSameBlocksHaveChanged) {
  remember(make_camera(40, 40, 25, 25, 80), 1, 0.02, Content::mixed, true);
  SeenPoints& seen = fixture_->seen();
  const auto again = [&] {
    return remembering_->remember(*fixture_->views().forgotten(), fixture_->views(), fixture_->map().block_size(), seen);
  };
  seen.clear();
  const std::vector<BlockKey> expected = again();
  EXPECT_TRUE(std::any_of(expected.begin(), expected.end(), [&](const BlockKey& block) { return seen.is_full(seen.table(block)); }));
  bool failed = true;
  for (std::size_t n = 0; failed && !HasFailure(); ++n) {
    SCOPED_TRACE("call " + std::to_string(n));
    seen.clear();
    FaultInjection::fail(n, 1);
    try {
      again();
      failed = false;
    } catch (const cl::Error&) {
    }
    FaultInjection::stop();
    EXPECT_TRUE(failed || n > 5);
    if (failed) {
      EXPECT_EQ(again(), expected);
    }
  }
}

TEST_F(SeenPointsTest, SavedAndLoadedPointsAreTheSame) {
  remember(cameras().front(), 3, 0.02, Content::mixed, true);
  const SeenSpace saved = fixture_->seen().saved();
  SeenPoints other(fixture_->commands(), fixture_->map().block_size());
  other.load(saved);
  const SeenSpace again = other.saved();
  ASSERT_EQ(again.points, saved.points);
  ASSERT_EQ(again.blocks.size(), saved.blocks.size());
  for (std::size_t n = 0; n < saved.blocks.size(); ++n) EXPECT_EQ(again.blocks[n].bytes, saved.blocks[n].bytes);
}

TEST_F(SeenPointsTest, BlocksComeAndGo) {
  remember(cameras().front(), 3, 0.02, Content::mixed, true);
  SeenPoints& seen = fixture_->seen();
  const SeenSpace saved = seen.saved();
  std::vector<SeenBlock> gone;
  for (std::size_t n = 0; n < saved.blocks.size(); n += 2) {
    const auto& [key, bytes] = saved.blocks[n];
    gone.push_back({{key[0], key[1], key[2]}, bytes});
    seen.drop_block(gone.back().first);
  }
  EXPECT_EQ(seen.saved().blocks.size(), saved.blocks.size() / 2);
  seen.add_blocks(gone);
  expect_right_points();
}

/// Also when all blocks have gone to the archive, or come from a file without a seen point.
TEST_F(SeenPointsTest, TheLatticeStaysOnceSomethingIsRemembered) {
  remember(cameras().front(), 1, 0.02, Content::mixed, true);
  SeenPoints& seen = fixture_->seen();
  const int shift = seen.shift();
  for (const BlockKey& block : seen.blocks()) seen.drop_block(block);
  const SeenSpace nothing = seen.saved();
  seen.choose_spacing(0.001);
  EXPECT_EQ(seen.shift(), shift);
  seen.load(nothing);
  EXPECT_EQ(seen.shift(), shift);
  seen.choose_spacing(0.001);
  EXPECT_GT(seen.shift(), shift) << "a file without a seen point decides nothing";
}

TEST_F(SeenPointsTest, UnitedBlocksHaveThePointsOfBoth) {
  SeenBlockBytes a, b;
  a.add_points([](int n) { return n % 2 == 0; });
  b.add_points([](int n) { return n % 3 == 0; });
  a.add_points([](int n) { return n % 2 == 0; });
  b.add_points([](int n) { return n % 2 == 1; });
  a.add_uniform(SEEN_NONE);
  b.add_points([](int n) { return n == 5; });
  a.add_uniform(SEEN_ALL);
  b.add_points([](int n) { return n == 5; });
  a.add_uniform(SEEN_NONE);
  b.add_uniform(SEEN_NONE);
  SeenBlockBytes expected;
  expected.add_points([](int n) { return n % 2 == 0 || n % 3 == 0; });
  expected.add_uniform(SEEN_ALL);
  expected.add_points([](int n) { return n == 5; });
  expected.add_uniform(SEEN_ALL);
  expected.add_uniform(SEEN_NONE);
  const auto of_a = a.take(), of_b = b.take(), of_both = expected.take();
  EXPECT_EQ(united_seen_blocks(of_a, of_b, 5), of_both);
  EXPECT_EQ(united_seen_blocks(of_b, of_a, 5), of_both);
  EXPECT_EQ(united_seen_blocks(of_a, {}, 5), of_a);
  EXPECT_EQ(united_seen_blocks({}, of_b, 5), of_b);
  EXPECT_THROW(united_seen_blocks(of_a, of_b, 4), FileError);
}

/// A box that crosses blocks and bricks.
Eigen::AlignedBox3d box_around(const Eigen::Vector3d& center) {
  return {center - Eigen::Vector3d(0.31, 0.72, 0.5), center + Eigen::Vector3d(0.4, 0.7, 0.33)};
}

/// Expects the points that are seen in `before` and lie outside of the box, and those that are seen in `later`.
void expect_forgotten(const SeenBits& before, const Eigen::AlignedBox3d& box, const SeenBits& after, const SeenBits& later) {
  const int n = before.points();
  std::size_t forgotten = 0;
  for (const auto& [block, bytes] : before.blocks())
    for (int z = block.z * n; z < (block.z + 1) * n; ++z)
      for (int y = block.y * n; y < (block.y + 1) * n; ++y)
        for (int x = block.x * n; x < (block.x + 1) * n; ++x) {
          const Eigen::Vector3d p = (Eigen::Array3d(x, y, z) + 0.5).matrix() * before.spacing();
          if ((p - box.min()).cwiseAbs().minCoeff() < 1e-6 || (p - box.max()).cwiseAbs().minCoeff() < 1e-6) continue;
          ASSERT_EQ(after.seen(x, y, z), (before.seen(x, y, z) && !box.contains(p)) || later.seen(x, y, z));
          forgotten += before.seen(x, y, z) && !after.seen(x, y, z);
        }
  EXPECT_GT(forgotten, 0u);
}

TEST_F(SeenPointsTest, PointsInABoxAreForgotten) {
  remember(cameras().front(), 3, 0.02, Content::mixed, true);
  const SeenSpace saved = fixture_->seen().saved();
  const Eigen::AlignedBox3d box = box_around(T_world_start_ * Eigen::Vector3d(0, 0, 0.4 * camera_.config.z_max));
  fixture_->seen().forget(box);
  expect_forgotten(SeenBits(saved), box, SeenBits(fixture_->seen().saved()), SeenBits({saved.block_size, saved.points, {}}));
}

/// Wherever the blocks are: all on disk, or some of them in memory.
TEST_F(SeenPointsTest, PointsInABoxAreForgottenOnDisk) {
  for (const double in_memory : {0.0, 1.2}) {
    SCOPED_TRACE(in_memory);
    views_.clear();
    remember(cameras().front(), 3, 0.02, Content::mixed, true);
    SeenPoints& seen = fixture_->seen();
    const double block_size = fixture_->map().block_size();
    const SeenSpace saved = seen.saved();
    const Eigen::Vector3d far_away = T_world_start_.translation() + Eigen::Vector3d(100, 0, 0);
    const SeenBits before(saved), nothing({saved.block_size, saved.points, {}});
    const Eigen::AlignedBox3d box = box_around(T_world_start_ * Eigen::Vector3d(0, 0, 0.4 * camera_.config.z_max));
    for (const BlockKey& block : seen.blocks()) seen.drop_block(block);
    remembering_->remember(*fixture_->views().forgotten(), fixture_->views(), block_size, seen);
    const SeenBits last(seen.saved());  // of the last view alone, which sees a part of the box again
    seen.load(saved);
    const TemporaryFolder folder("seen_points");
    Config config = camera_.config;
    config.map_folder = folder.path().string();
    config.eviction_radius = in_memory;
    const auto open = [&] {
      return std::make_unique<MapArchive>(config, fixture_->map(), seen, fixture_->views(), [] { return std::vector<BlockKey>(); });
    };
    const auto all = [&](const MapArchive& archive) {
      SavedMap map = {{}, seen.saved(), {}};
      archive.add_stored(map);
      return SeenBits(map.seen);
    };
    {
      const auto archive = open();
      archive->note_changed(seen.blocks_with_points());
      archive->flush(1);
      archive->follow(far_away, 0, 2);
      ASSERT_TRUE(seen.empty());
      if (in_memory > 0) archive->follow(box.center(), 0, 3);
      EXPECT_EQ(seen.empty(), in_memory == 0);
      EXPECT_LT(seen.blocks().size(), before.blocks().size());
      archive->forget(box);
      expect_forgotten(before, box, all(*archive), nothing);
      archive->note_changed(remembering_->remember(*fixture_->views().forgotten(), fixture_->views(), block_size, seen));
      expect_forgotten(before, box, all(*archive), last);
      archive->flush(4);
      archive->follow(-far_away, 0, 5);
      ASSERT_TRUE(seen.empty());
      expect_forgotten(before, box, all(*archive), last);
    }
    expect_forgotten(before, box, all(*open()), last);
  }
}

TEST_F(SeenPointsTest, DamagedBlocksAreRefused) {
  remember(cameras().front(), 1, 0.02, Content::mixed, true);
  SeenSpace saved = fixture_->seen().saved();
  saved.blocks.front().bytes.pop_back();
  EXPECT_THROW(SeenPoints::check(saved), FileError);
  saved.blocks.front().bytes.assign(8, 3);
  EXPECT_THROW(SeenPoints::check(saved), FileError);
  saved.points = 33;
  EXPECT_THROW(SeenPoints::check(saved), FileError);
}

TEST_F(SeenPointsTest, CandidatesInSeenSpaceAreSettled) {
  std::size_t all_settled = 0;
  for (const CameraSetup& camera : cameras())
    for (const double density : {0.02, 0.9}) {
      SCOPED_TRACE(camera.name + ", density " + std::to_string(density));
      views_.clear();
      remember(camera, 3, 0.02, Content::mixed, true);
      fixture_->begin(random_image(camera_, Content::all_valid, random_), T_world_start_);
      Candidates left(fixture_->commands());
      const Field<char> candidates = random_field(fixture_->grid(), density, random_);
      fixture_->write(left, candidates);
      ViewSettling settling(fixture_->commands());
      settling.settle(fixture_->frame(), fixture_->camera(), fixture_->views(), fixture_->seen(), fixture_->taken(), left);
      const SeenBits bits(fixture_->seen().saved());
      const Nuvg grid(camera_.intrinsics, camera_.config);
      Field<Truth> expected = grid.field(Truth::no);
      std::size_t settled = 0;
      for_each_voxel(candidates, [&](int i, int j, int k) {
        if (!candidates(i, j, k)) return;
        expected(i, j, k) = !less(SEEN_SHARE, bits.share(T_world_start_ * grid.center_of(i, j, k)), 2e-3);
        settled += expected(i, j, k) == Truth::no;
      });
      expect_equal("candidates left", expected, fixture_->read(left));
      all_settled += settled;
    }
  EXPECT_GT(all_settled, 1000u);
}

}  // namespace
}  // namespace frontier_surfels
