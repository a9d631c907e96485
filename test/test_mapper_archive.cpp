/// Maps larger than memory: with a map folder the map is the same as without, wherever its blocks are.
#include "mapper_archive_input.hpp"
#include "stages/test_device.hpp"

namespace frontier_surfels {
namespace {

float furthest(const std::vector<Surfel>& surfels, const replay::RecordedFrame& frame) {
  float distance = 0;
  for (const Surfel& s : surfels)
    distance = std::max(distance, (s.position - frame.T_world_camera.translation().cast<float>()).cwiseAbs().maxCoeff());
  return distance;
}

TEST_F(MapperArchive, ThereAndBackGivesTheSameMap) {
  const Frames frames = walk_there_and_back(30);
  Mapper plain(walking()), mapper(walking(path_));
  Follower follower;
  std::size_t removed = 0, moves = 0;
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const Report expected = plain.integrate(frames[n].view()), report = mapper.integrate(frames[n].view());
    ASSERT_EQ(std::tie(report.created, report.removed, report.split, report.in_view),
              std::tie(expected.created, expected.removed, expected.split, expected.in_view))
        << "frame " << n;
    removed += report.removed;
    const std::vector<Surfel> near = mapper.surfels();
    ASSERT_EQ(report.surfels, near.size());
    follower.apply(mapper.changes(follower.sequence()));
    ASSERT_TRUE(same(follower.surfels(), near)) << "followed to frame " << n;
    ASSERT_LT(furthest(near, frames[n]), 9.0F) << "frame " << n;
    ASSERT_EQ(mapper.size() + mapper.size_on_disk(), plain.size()) << "frame " << n;
    moves += near.size() < plain.size();
    if (n % 40 != 0 && n + 1 != frames.size()) continue;
    ASSERT_TRUE(same(saved(mapper), sorted(plain.surfels()))) << "frame " << n;
    Follower late;
    late.apply(mapper.changes(0));
    ASSERT_TRUE(same(late.surfels(), near));
  }
  EXPECT_GT(removed, 1000u) << "the way back must change blocks that had left memory";
  EXPECT_GT(moves, frames.size() / 2);
  EXPECT_LT(mapper.size(), plain.size() / 2);
}

TEST_F(MapperArchive, MemoryIsBoundedAndTheFolderGrows) {
  const Frames frames = walk_there(60);
  Mapper plain(walking()), mapper(walking(path_));
  std::vector<Report> reports, plain_reports;
  for (const auto& frame : frames) {
    reports.push_back(mapper.integrate(frame.view()));
    plain_reports.push_back(plain.integrate(frame.view()));
  }
  const std::size_t early = frames.size() / 4;
  EXPECT_LT(reports.back().map_bytes, 1.2 * reports[early].map_bytes);
  EXPECT_LT(reports.back().device_bytes, 1.2 * reports[early].device_bytes);
  EXPECT_GT(plain_reports.back().map_bytes, 3 * plain_reports[early].map_bytes);
  EXPECT_GT(saved(mapper).size(), 4 * mapper.size());
}

/// The image is so wide that its known space is wider than eviction_radius.
TEST_F(MapperArchive, AWideViewKeepsWhatItNeeds) {
  Frames frames;
  for (const double y : {0.0, 6.0, 12.0, 6.1, 0.1})
    frames.push_back(plane_frame(plain_camera(60, 44, 10), 1.4, look_along({0, y, 0}, {1, 0, 0})));
  Mapper plain(walking()), mapper(walking(path_));
  for (const auto& frame : frames) {
    plain.integrate(frame.view());
    mapper.integrate(frame.view());
    EXPECT_TRUE(same(saved(mapper), sorted(plain.surfels())));
  }
}

TEST_F(MapperArchive, AReopenedFolderGoesOnWithItsMap) {
  const Frames frames = walk_there(12);
  std::vector<Surfel> before;
  Report first;
  {
    Mapper mapper(walking(path_));
    first = mapper.integrate(frames[0].view());
    integrate_all(mapper, {frames.begin() + 1, frames.end()});
    before = saved(mapper);
  }
  EXPECT_TRUE(same(stored(), before)) << "a mapper that ends normally stores everything";

  Mapper mapper(walking(path_));
  EXPECT_EQ(mapper.size(), 0u) << "nothing is near before the first frame";
  EXPECT_EQ(mapper.size_on_disk(), before.size());
  EXPECT_TRUE(same(saved(mapper), before));
  EXPECT_TRUE(same(sorted(mapper.whole_map()), before));
  const Report again = mapper.integrate(frames[0].view());
  EXPECT_GT(again.surfels, first.surfels);
  EXPECT_LT(mapper.size(), before.size()) << "only near blocks are in memory";
  EXPECT_LT(mapper.size(), mapper.whole_map().size());
  EXPECT_LT(again.created, first.created / 30) << "the space is known already";
  for (const auto& frame : frames) mapper.integrate(frame.view());
  const auto after = static_cast<double>(saved(mapper).size());
  EXPECT_NEAR(after / static_cast<double>(before.size()), 1, 0.03);
}

TEST_F(MapperArchive, ResetAndLoadReplaceTheMapOnDiskToo) {
  const Frames frames = walk_there(15);
  const std::string file = (root_ / "first.ply").string();
  Mapper first(walking());
  integrate_all(first, {frames.begin(), frames.begin() + 3});
  first.save(file);
  {
    Mapper mapper(walking(path_));
    integrate_all(mapper, frames);
    mapper.load(file);
    EXPECT_TRUE(same(saved(mapper), sorted(first.surfels())));
    integrate_all(mapper, frames);
    mapper.reset();
    EXPECT_EQ(mapper.size() + mapper.size_on_disk(), 0u);
    EXPECT_TRUE(saved(mapper).empty());
    mapper.load(file);
    Follower follower;
    follower.apply(mapper.changes(0));
    EXPECT_TRUE(same(follower.surfels(), mapper.surfels()));
  }
  EXPECT_TRUE(same(stored(), sorted(first.surfels()))) << "a load is stored even if no frame follows";

  const std::vector<Surfel> all = [&] {
    Mapper mapper(walking());
    integrate_all(mapper, frames);
    return mapper.surfels();
  }();
  {
    Mapper mapper(walking(path_));
    mapper.load(all);
    mapper.integrate(plane_frame(plain_camera(40, 30, 36), 0, frames[0].T_world_camera).view());
    EXPECT_LT(mapper.size(), all.size()) << "far blocks of a loaded map leave memory";
    EXPECT_TRUE(same(saved(mapper), sorted(all)));
    mapper.reset();
  }
  EXPECT_TRUE(stored().empty());
}

TEST_F(MapperArchive, TheSameForAnyNumberOfThreads) {
  if (!can_be_divided(choose_device({}))) GTEST_SKIP() << "The device cannot be divided.";
  const Frames frames = walk_there_and_back(12);
  std::vector<Surfel> near, all;
  for (const int threads : {0, 1, 0}) {
    Config config = walking(path_);
    config.threads = threads;
    {
      Mapper mapper(config);
      integrate_all(mapper, frames);
      if (all.empty()) {
        near = mapper.surfels();
        all = saved(mapper);
      }
      EXPECT_TRUE(same(near, mapper.surfels())) << threads << " threads, ids included";
      EXPECT_TRUE(same(all, saved(mapper)));
    }
    EXPECT_TRUE(same(all, stored()));
    std::filesystem::remove_all(path_);
  }
  EXPECT_GT(all.size(), near.size());
}

}  // namespace
}  // namespace frontier_surfels
