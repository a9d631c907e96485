/// The grid of states, as the mapper makes it: cells against points and surfels, and changes against the whole.
#include "frontier_surfels/planner/state_grid.hpp"
#include "planner_input.hpp"

namespace frontier_surfels {
namespace {

constexpr double kResolution = 0.05;

TEST(MapperStateChanges, CellsAgainstPointsAndSurfels) {
  Mapper mapper(as_recorded());
  integrate_all(mapper, orbit_frames(coarse_camera(), 30, 5));
  StateGrid grid(kResolution);
  ASSERT_TRUE(grid.apply(mapper.state_changes(0, kResolution)));
  std::map<std::array<int, 3>, int> passes;  // of surfels through cells: 1 frontier, 2 occupied
  const std::vector<Surfel> surfels = mapper.surfels();
  for (const Surfel& surfel : surfels) {
    const Eigen::Array3f reach = surfel.radius * (1 - surfel.normal.array().square()).max(0).sqrt();
    const Eigen::Array3i low = ((surfel.position.array() - reach) / kResolution).floor().cast<int>(),
                         high = ((surfel.position.array() + reach) / kResolution).floor().cast<int>();
    for (int x = low.x(); x <= high.x(); ++x)
      for (int y = low.y(); y <= high.y(); ++y)
        for (int z = low.z(); z <= high.z(); ++z) passes[{x, y, z}] |= surfel.label == Label::kOccupied ? 2 : 1;
  }
  std::mt19937 random(1);
  std::vector<std::array<int, 3>> cells;
  Points centres;
  const Eigen::AlignedBox3f box = box_around(surfels);
  for (float x = box.min().x() - 0.5F; x < box.max().x() + 0.5F; x += kResolution)
    for (float y = box.min().y() - 0.5F; y < box.max().y() + 0.5F; y += kResolution)
      for (float z = box.min().z() - 0.5F; z < box.max().z() + 0.5F; z += kResolution) {
        if (random() % 8 != 0) continue;
        const Eigen::Array3i cell = (Eigen::Array3f(x, y, z) / kResolution).floor().cast<int>();
        cells.push_back({cell.x(), cell.y(), cell.z()});
        centres.push_back(((cell.cast<double>() + 0.5) * kResolution).cast<float>().matrix());
      }
  const std::vector<SpaceState> states = mapper.states(centres);
  std::size_t count[3] = {}, wrong = 0;
  for (std::size_t n = 0; n < cells.size(); ++n) {
    const auto pass = passes.find(cells[n]);
    const SpaceState state = grid.state(centres[n]);
    ++count[static_cast<int>(state)];
    if (pass == passes.end())
      wrong += (state == SpaceState::kFree) != (states[n] == SpaceState::kFree) && states[n] != SpaceState::kOccupied;
    else
      wrong += state != ((pass->second & 2) != 0 ? SpaceState::kOccupied : SpaceState::kUnknown);
  }
  EXPECT_LE(wrong, cells.size() / 10000);  // discs that touch a cell in a point, with rounding
  for (const std::size_t some : count) EXPECT_GT(some, 500U);
}

/// The same frames twice: what the mapper keeps of its cells against cells that are all found anew.
struct Followed {
  Mapper mapper, anew;
  StateGrid grid{kResolution};

  explicit Followed(const Config& config) : mapper(config), anew(config) {}

  Report integrate(const DepthFrame& frame) {
    anew.integrate(frame);
    return mapper.integrate(frame);
  }

  StateGrid whole(double resolution) {
    anew.state_changes(0, resolution / 2 + 0.3);  // cells of another size: those that are kept are dropped
    StateGrid whole(resolution);
    EXPECT_TRUE(whole.apply(anew.state_changes(0, resolution)));
    return whole;
  }

  void expect_same(StateGrid& follower) {
    follower.take(mapper.state_changes(follower.sequence(), follower.resolution()));
    EXPECT_EQ(follower.whole().blocks, whole(follower.resolution()).whole().blocks) << mapper.sequence();
    EXPECT_EQ(follower.sequence(), mapper.sequence());
  }
  void expect_same() { expect_same(grid); }
};

TEST(MapperStateChanges, ChangesAddUpToTheWhole) {
  const Frames frames = orbit_frames(coarse_camera(), 24, 5);
  Followed both(as_recorded());
  std::size_t n = 0;
  for (const auto& frame : frames) {
    both.integrate(frame.view());
    if (++n % 5 == 0) both.expect_same();
  }
  EXPECT_GT(both.grid.whole().blocks.size(), 20U);
  both.expect_same();
  EXPECT_TRUE(both.mapper.state_changes(both.grid.sequence(), kResolution).blocks.empty());
  const std::vector<Surfel> surfels = both.mapper.surfels();
  for (Mapper* mapper : {&both.mapper, &both.anew}) mapper->reset();
  both.expect_same();
  EXPECT_TRUE(both.grid.whole().blocks.empty());
  both.integrate(frames.front().view());
  both.expect_same();
  for (Mapper* mapper : {&both.mapper, &both.anew}) mapper->load(surfels);
  both.expect_same();
  EXPECT_GT(both.grid.whole().blocks.size(), 20U);
}

TEST(MapperStateChanges, ReadersDoNotDisturbEachOther) {
  Followed both(as_recorded());
  StateGrid slow(kResolution), coarse(0.13);
  std::size_t n = 0;
  for (const auto& frame : orbit_frames(coarse_camera(), 24, 5)) {
    both.integrate(frame.view());
    ++n;
    if (n % 2 == 0) both.expect_same();
    if (n % 5 == 0) both.expect_same(slow);
    if (n % 7 == 0) both.expect_same(coarse);
  }
}

/// A reader that asks seldom gets what one gets that asks always, also if nobody has asked between.
TEST(MapperStateChanges, ABoxComesAndGoes) {
  Config config = as_recorded();
  config.z_max = 3;
  Followed both(config);
  StateGrid slow(kResolution);
  std::size_t taken_back = 0;
  const auto free_behind = [&] { return both.grid.state({0.05F, 0, 1.6F}) == SpaceState::kFree; };
  for (int n = 0; n < 60; ++n) {
    const double x = 0.008 * n, front = 1.5, half_side = 0.25;
    replay::RecordedFrame frame = plane_frame(working_camera(), 2, Eigen::Isometry3d(Eigen::Translation3d(x, 0, 0)));
    const Intrinsics& camera = frame.intrinsics;
    for (int v = 0; n >= 20 && n < 40 && v < camera.height; ++v)
      for (int u = 0; u < camera.width; ++u)
        if (std::abs(x + (u - camera.cx) / camera.fx * front) < half_side && std::abs((v - camera.cy) / camera.fy * front) < half_side)
          frame.depth.at<float>(v, u) = static_cast<float>(front);
    taken_back += both.integrate(frame.view()).taken_back;
    if (n % 4 == 3) both.expect_same();
    if (n == 25 || n == 50) both.expect_same(slow);
    if (n == 19 || n == 59) {
      EXPECT_TRUE(free_behind());
    }
    if (n == 39) {
      EXPECT_FALSE(free_behind());
    }
  }
  EXPECT_GT(taken_back, 100U);
}

/// What views have seen stays free in the grid when they are forgotten, where no surfel stands.
TEST(MapperStateChanges, ForgettingIsNoChange) {
  Config config = as_recorded();
  config.recent_views = 3;
  Mapper mapper(config), all(as_recorded());
  StateGrid grid(kResolution), exact(kResolution);
  const Frames frames = orbit_frames(coarse_camera(), 40, 5);
  for (const auto& frame : frames) {
    mapper.integrate(frame.view());
    all.integrate(frame.view());
    grid.take(mapper.state_changes(grid.sequence(), kResolution));
  }
  exact.take(all.state_changes(0, kResolution));
  std::size_t different = 0, cells = 0;
  for (const StateBlock& block : exact.whole().blocks)
    for (int n = 0; n < StateBlock::kCells; ++n) {
      const Eigen::Vector3f centre =
          (Eigen::Vector3f(16 * block.block[0] + n % 16, 16 * block.block[1] + n / 16 % 16, 16 * block.block[2] + n / 256) +
           Eigen::Vector3f::Constant(0.5F)) *
          static_cast<float>(kResolution);
      ++cells;
      different += block.state(n) != grid.state(centre);
    }
  EXPECT_LE(different, cells / 50);
  EXPECT_GT(cells, 10000U);
}

TEST(MapperStateChanges, SameOnAnyNumberOfThreads) {
  std::vector<StateBlock> blocks[2];
  for (int n = 0; n < 2; ++n) {
    Config config = as_recorded();
    config.threads = 1 + n;
    Mapper mapper(config);
    integrate_all(mapper, orbit_frames(coarse_camera(), 12, 5));
    blocks[n] = mapper.state_changes(0, kResolution).blocks;
  }
  EXPECT_EQ(blocks[0], blocks[1]);
  EXPECT_GT(blocks[0].size(), 20U);
}

TEST(MapperStateChanges, AResolutionWithoutSenseIsRefused) {
  const Mapper mapper(as_recorded());
  for (const double resolution : {0.001, 1.5, -0.05, std::nan("")}) EXPECT_THROW(mapper.state_changes(0, resolution), Error);
  EXPECT_TRUE(mapper.state_changes(0, kResolution).blocks.empty());
}

}  // namespace
}  // namespace frontier_surfels
