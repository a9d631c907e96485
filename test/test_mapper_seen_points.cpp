/// Maps whose views have been forgotten: nothing is lost but a little sharpness, and saved maps go on as if nothing had happened.
#include "frontier_surfels/map_file.hpp"
#include "mapper_archive_input.hpp"
#include "opencl/fault_injection.hpp"

namespace frontier_surfels {
namespace {

Config few_views(int recent_views) {
  Config config = undecimated();
  config.recent_views = recent_views;
  config.correct_poses = false;  // the last frames, by which poses are corrected, are not saved
  return config;
}

bool has_stage(const Report& report, const std::string& name) {
  return std::any_of(report.stages.begin(), report.stages.end(), [&](const StageTime& stage) { return stage.name == name; });
}

/// A camera that hovers: it moves to and fro by a millimetre, less than what makes a view worth keeping.
Frames hovering_frames(int count) {
  const replay::Room room;
  const Frames orbit = orbit_frames(coarse_camera(), 1);
  Frames frames;
  for (int n = 0; n < count; ++n) {
    const Eigen::Translation3d motion(0.001 * std::sin(n), 0.001 * std::cos(1.7 * n), 0.001 * std::sin(2.3 * n));
    frames.push_back(room_frame(room, coarse_camera(), motion * orbit.front().T_world_camera));
  }
  return frames;
}

TEST(MapperSeenPoints, ForgottenViewsAreHardlyMissed) {
  const Frames frames = orbit_frames(coarse_camera(), 60, 2);
  const Config config = undecimated();
  const auto all_kept = map_of(frames, few_views(700)), few_kept = map_of(frames, few_views(5)), none_kept = map_of(frames, few_views(0));
  const auto expected = score(all_kept, frames, config);
  for (const auto& surfels : {few_kept, none_kept}) {
    const auto s = score(surfels, frames, config);
    SCOPED_TRACE(text(s, surfels.size()));
    EXPECT_GT(s.right, expected.right - 0.01);
    EXPECT_LT(s.fdr_5cm, expected.fdr_5cm + 0.001);
    EXPECT_LT(s.miss_5cm, expected.miss_5cm + 0.001);
  }
}

TEST(MapperSeenPoints, AHoveringCameraLeavesNoWrongSurfels) {
  const Frames frames = hovering_frames(30);
  const auto surfels = map_of(frames, undecimated());
  const auto s = score(surfels, frames, undecimated());
  EXPECT_GT(s.right, 0.99) << text(s, surfels.size());
}

/// A frame is refused after the device was asked what the forgotten view sees.
TEST(MapperSeenPoints, RefusedFramesDoNotDisturbWhatIsRemembered) {
  Mapper mapper(few_views(2)), undisturbed(few_views(2));
  for (const auto& frame : orbit_frames(coarse_camera(), 10, 5)) {
    DepthFrame refused = frame.view();
    refused.depth.data = nullptr;
    EXPECT_THROW(mapper.integrate(refused), BadFrame);
    FaultInjection::stop();
    EXPECT_THROW(mapper.integrate(refused), BadFrame);
    EXPECT_EQ(FaultInjection::count(), 0U);  // the device is not asked again
    mapper.integrate(frame.view());
    undisturbed.integrate(frame.view());
  }
  EXPECT_TRUE(same_memory(mapper.saved_map(), undisturbed.saved_map()));
}

TEST(MapperSeenPoints, AStillCameraFillsNothing) {
  const Frames frames = orbit_frames(coarse_camera(), 1);
  Mapper mapper(few_views(3));
  for (int n = 0; n < 3; ++n) mapper.integrate(frames.front().view());
  const Statistics before = mapper.statistics();
  for (int n = 0; n < 20; ++n) mapper.integrate(frames.front().view());
  EXPECT_EQ(mapper.statistics().seen_bytes, before.seen_bytes);
  EXPECT_LE(mapper.statistics().device_bytes, before.device_bytes);
  EXPECT_EQ(mapper.statistics().surfels, before.surfels);
}

TEST(MapperSeenPoints, TheSurfelsAreNotAskedWhatIsKnown) {
  const Frames frames = orbit_frames(coarse_camera(), 8, 5);
  Mapper mapper(few_views(2));
  for (const auto& frame : frames) EXPECT_FALSE(has_stage(mapper.integrate(frame.view()), "sign_field"));
  Config paper = few_views(2);
  paper.seen_points = false;
  Mapper as_in_the_paper(paper);
  Report last;
  for (const auto& frame : frames) last = as_in_the_paper.integrate(frame.view());
  EXPECT_TRUE(has_stage(last, "sign_field"));
  EXPECT_FALSE(has_stage(last, "remembering"));
  EXPECT_LT(mapper.statistics().device_bytes, as_in_the_paper.statistics().device_bytes);
}

TEST(MapperSeenPoints, TheSameForAnyNumberOfThreads) {
  const Frames frames = orbit_frames(coarse_camera(), 30, 3);
  Config one = few_views(4), two = few_views(4);
  one.threads = 1;
  two.threads = 2;
  const auto surfels = map_of(frames, one);
  EXPECT_TRUE(same(surfels, map_of(frames, two)));
  EXPECT_TRUE(same(surfels, map_of(frames, few_views(4))));
}

/// A map that is saved and loaded in the middle, by a file or without one.
class SavedInTheMiddle : public MapperArchive {
 protected:
  const Frames frames_ = orbit_frames(coarse_camera(), 40, 3);
  const Frames first_{frames_.begin(), frames_.begin() + 20}, second_{frames_.begin() + 20, frames_.end()};
  Mapper whole_{few_views(6)}, half_{few_views(6)};

  void SetUp() override {
    integrate_all(whole_, frames_);
    integrate_all(half_, first_);
  }
};

TEST_F(SavedInTheMiddle, GoesOnAsIfNothingHadHappened) {
  Mapper other(few_views(6));
  other.load(half_.saved_map());
  integrate_all(other, second_);
  EXPECT_TRUE(same(sorted(other.surfels()), sorted(whole_.surfels())));
}

TEST_F(SavedInTheMiddle, AlsoFromAFile) {
  const std::string file = (root_ / "half.ply").string();
  half_.save(file);
  Mapper other(few_views(6));
  other.load(file);
  integrate_all(other, second_);
  EXPECT_TRUE(same(sorted(other.surfels()), sorted(whole_.surfels())));
}

TEST_F(SavedInTheMiddle, SavingChangesNothing) {
  half_.save((root_ / "half.ply").string());
  integrate_all(half_, second_);
  EXPECT_TRUE(same(half_.surfels(), whole_.surfels()));
}

TEST_F(SavedInTheMiddle, FewerViewsThanWereSaved) {
  Mapper other(few_views(2));
  other.load(half_.saved_map());
  integrate_all(other, second_);
  const auto s = score(other.surfels(), frames_, undecimated()), expected = score(whole_.surfels(), frames_, undecimated());
  EXPECT_GT(s.right, expected.right - 0.01) << text(s, other.size());
}

/// Only the surfels are there: what has been seen is filled in.
TEST_F(SavedInTheMiddle, SurfelsAlone) {
  Mapper other(few_views(6));
  other.load(half_.surfels());
  integrate_all(other, second_);
  const auto s = score(other.surfels(), frames_, undecimated());
  SCOPED_TRACE(text(s, other.size()));
  EXPECT_GT(s.right, 0.97);
  EXPECT_LT(s.miss_5cm, 0.01);
  EXPECT_GT(other.statistics().seen_bytes, 0u);
}

TEST_F(SavedInTheMiddle, DamageIsRefused) {
  SavedMap map = half_.saved_map();
  ASSERT_FALSE(map.seen.blocks.empty());
  map.seen.blocks.front().bytes.push_back(0);
  Mapper other(few_views(6));
  integrate_all(other, second_);
  const auto before = other.surfels();
  EXPECT_THROW(other.load(map), FileError);
  EXPECT_TRUE(same(other.surfels(), before));
}

TEST_F(SavedInTheMiddle, InAMapFolder) {
  Config config = few_views(6);
  config.map_folder = path_;
  for (const Frames* half : {&first_, &second_}) {
    Mapper mapper(config);
    integrate_all(mapper, *half);
  }
  const Mapper reopened(config);
  SavedMap map = reopened.saved_map();
  EXPECT_TRUE(same(sorted(map.surfels), sorted(whole_.surfels())));
  const SavedMap expected = whole_.saved_map();
  EXPECT_EQ(map.views.size(), expected.views.size());
  EXPECT_EQ(map.seen.blocks.size(), expected.seen.blocks.size());
}

/// Views of a walk that are kept until the blocks that they have seen are on disk.
TEST_F(MapperArchive, ViewsThatAreKeptLongerThanBlocks) {
  const Frames frames = walk_there_and_back(20);
  Config config = walking();
  config.recent_views = 50;
  Mapper plain(config);
  integrate_all(plain, frames);
  const SavedMap expected = plain.saved_map();
  config.map_folder = path_;
  config.eviction_radius = 4.5;
  {
    Mapper mapper(config);
    integrate_all(mapper, frames);
    EXPECT_LT(mapper.size(), plain.size());
    const SavedMap map = mapper.saved_map();
    EXPECT_TRUE(same(sorted(map.surfels), sorted(expected.surfels)));
    EXPECT_TRUE(same_memory(map, expected));
  }
  const SavedMap reopened = Mapper(config).saved_map();
  EXPECT_TRUE(same(sorted(reopened.surfels), sorted(expected.surfels)));
  EXPECT_TRUE(same_memory(reopened, expected));
}

/// Blocks without surfels, in which something has been seen, are stored as well.
TEST_F(MapperArchive, ALoadedMapIsStoredWithItsSeenPoints) {
  Mapper plain(few_views(2));
  integrate_all(plain, orbit_frames(coarse_camera(), 10, 5));
  const SavedMap map = plain.saved_map();
  Config config = few_views(2);
  config.map_folder = path_;
  Mapper(config).load(map);
  EXPECT_TRUE(same_memory(Mapper(config).saved_map(), map));
}

/// The paper's known space does not use what another configuration has remembered in the same folder.
TEST_F(MapperArchive, ThePaperDoesNotUseSeenPointsOfAFolder) {
  const Frames frames = orbit_frames(coarse_camera(), 10, 5);
  Config config = few_views(2);
  config.map_folder = path_;
  integrate_all(*std::make_unique<Mapper>(config), frames);
  config.seen_points = false;
  Mapper paper(config);
  EXPECT_TRUE(has_stage(paper.integrate(frames.back().view()), "sign_field"));
}

/// Views that nobody uses now stay in the folder for those who will.
TEST_F(MapperArchive, ThePaperKeepsTheViewsOfAFolder) {
  const Frames frames = orbit_frames(coarse_camera(), 10, 5);
  Config config = few_views(20);
  config.map_folder = path_;
  integrate_all(*std::make_unique<Mapper>(config), frames);
  Config paper = config;
  paper.recent_views = 0;
  paper.seen_points = false;
  std::make_unique<Mapper>(paper)->flush();
  EXPECT_EQ(Mapper(config).saved_map().views.size(), frames.size());
}

/// Cameras of other resolutions may come before anything has been forgotten.
TEST_F(MapperArchive, BlocksWithoutSeenPointsDecideNoLattice) {
  Frames frames = orbit_frames(coarse_camera(), 6, 5);
  Intrinsics fine = coarse_camera();
  for (double* number : {&fine.fx, &fine.fy, &fine.cx, &fine.cy}) *number *= 4;
  fine.width *= 4;
  fine.height *= 4;
  const Frames others = orbit_frames(fine, 6, 5);
  Config config = few_views(1);
  config.recent_views = static_cast<int>(frames.size());
  config.map_folder = path_;
  {
    Mapper mapper(config);
    integrate_all(mapper, frames);
    mapper.flush();  // blocks without seen points
    integrate_all(mapper, others);
    mapper.flush();
  }
  Mapper again(config);
  EXPECT_FALSE(again.saved_map().seen.blocks.empty());
  integrate_all(again, frames);
}

/// What such a map lacks is filled in when it is loaded, and not taken for never seen.
TEST(MapperSeenPoints, AMapWithoutSeenPointsSaysSo) {
  Config paper = few_views(0);
  paper.seen_points = false;
  Mapper mapper(paper);
  integrate_all(mapper, orbit_frames(coarse_camera(), 6, 5));
  const SavedMap saved = mapper.saved_map();
  EXPECT_EQ(saved.seen.points, 0);
  Mapper filled(few_views(0));
  filled.load(saved);
  EXPECT_FALSE(filled.saved_map().seen.blocks.empty());
}

TEST(MapperSeenPoints, UnsoundViewsAreRefused) {
  Mapper mapper(few_views(5));
  integrate_all(mapper, orbit_frames(coarse_camera(), 3, 5));
  const SavedMap sound = mapper.saved_map();
  const auto refused = [&](const std::function<void(SavedView&)>& spoil) {
    SavedMap map = sound;
    spoil(map.views.front());
    EXPECT_THROW(mapper.load(map), FileError);
    EXPECT_TRUE(same(mapper.surfels(), sound.surfels)) << "the map stays as it was";
  };
  refused([](SavedView& view) { view = SavedView(); });
  refused([](SavedView& view) { view.depth.clear(); });
  refused([](SavedView& view) { view.T_world_camera.translation().x() = std::nan(""); });
}

/// The map with a further kept view, of 2.8 million pixels: 1024 such views are too many.
SavedMap with_a_large_view(SavedMap map) {
  constexpr int kScale = 24;
  SavedView large = map.views.back();
  for (double* number : {&large.intrinsics.fx, &large.intrinsics.fy, &large.intrinsics.cx, &large.intrinsics.cy}) *number *= kScale;
  large.intrinsics.width *= kScale;
  large.intrinsics.height *= kScale;
  large.depth.assign(large.depth.size() * kScale * kScale, static_cast<std::uint16_t>(1 / large.depth_step));
  map.views.push_back(std::move(large));
  return map;
}

TEST_F(MapperArchive, ViewsThatAreTooLargeAreRefusedAndTheMapStays) {
  const Frames frames = orbit_frames(coarse_camera(), 4, 5);
  Mapper plain(few_views(1024)), mapper(few_views(1024));
  integrate_all(plain, {frames.begin(), frames.end() - 1});
  integrate_all(mapper, {frames.begin(), frames.end() - 1});
  const std::string file = (root_ / "large.ply").string();
  write_map(file, with_a_large_view(mapper.saved_map()));
  const std::string said = fault_of<FileError>([&] { mapper.load(file); });
  EXPECT_NE(said.find(file + " cannot be loaded. The 1024 kept views would have 2.9"), std::string::npos) << said;
  EXPECT_NE(said.find("lower recent_views."), std::string::npos) << said;
  EXPECT_TRUE(same(mapper.surfels(), plain.surfels()));
  EXPECT_TRUE(same_memory(mapper.saved_map(), plain.saved_map()));
  plain.integrate(frames.back().view());
  mapper.integrate(frames.back().view());
  EXPECT_TRUE(same(mapper.surfels(), plain.surfels()));
}

TEST_F(MapperArchive, AFolderWithViewsThatAreTooLargeKeepsThem) {
  Config config = few_views(5);
  Mapper plain(config);
  integrate_all(plain, orbit_frames(coarse_camera(), 3, 5));
  const SavedMap map = with_a_large_view(plain.saved_map());
  config.map_folder = path_;
  Mapper(config).load(map);
  Config too_many = config;
  too_many.recent_views = 1024;
  const std::string said = fault_of<FileError>([&] { Mapper mapper(too_many); });
  EXPECT_NE(said.find("lower recent_views."), std::string::npos) << said;
  EXPECT_TRUE(same_memory(Mapper(config).saved_map(), map));
}

/// A map keeps its lattice, whatever is asked for later.
TEST_F(MapperArchive, ASpacingThatTheMapDoesNotHaveIsWarnedOf) {
  const Frames frames = orbit_frames(coarse_camera(), 3, 5);
  Config config = few_views(0);
  Mapper plain(config);
  integrate_all(plain, frames);
  const SavedMap map = plain.saved_map();
  const double spacing = map.seen.block_size / map.seen.points;
  for (const double asked : {0.0, spacing, 1.9 * spacing, 2 * spacing, 0.9 * spacing}) {
    SCOPED_TRACE(asked);
    const bool differs = asked == 2 * spacing || asked == 0.9 * spacing;
    const auto check = [&](Mapper& mapper) {
      const std::vector<std::string> warnings = mapper.take_warnings();
      ASSERT_EQ(warnings.size(), differs ? 1u : 0u);
      if (differs) {
        EXPECT_NE(warnings[0].find("seen_spacing is "), std::string::npos) << warnings[0];
      }
      EXPECT_TRUE(mapper.take_warnings().empty());
      EXPECT_EQ(mapper.saved_map().seen.points, map.seen.points);
    };
    Config other = config;
    other.seen_spacing = asked;
    Mapper loaded(other);
    EXPECT_TRUE(loaded.take_warnings().empty());
    loaded.load(map);
    check(loaded);
    other.map_folder = (root_ / std::to_string(asked)).string();
    Mapper(other).load(map);
    Mapper reopened(other);
    check(reopened);
  }
}

/// Near voxels are small: the points do not become as small as these.
TEST(MapperSeenPoints, AreNoFinerThanTheVoxelsAtASixthOfTheRange) {
  Config config = few_views(0);
  Mapper usual(config);
  integrate_all(usual, orbit_frames(coarse_camera(), 3, 5));
  config.z_min = 0.1;
  Mapper near(config);
  integrate_all(near, orbit_frames(coarse_camera(), 3, 5));
  EXPECT_EQ(near.saved_map().seen.points, usual.saved_map().seen.points);
}

}  // namespace
}  // namespace frontier_surfels
