/// Saving, loading and resetting maps, and their statistics.
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <tuple>

#include "frontier_surfels/map_file.hpp"
#include "mapper_input.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

std::vector<Surfel> sorted(std::vector<Surfel> surfels) {
  const auto key = [](const Surfel& s) {
    return std::make_tuple(s.position.x(), s.position.y(), s.position.z(), s.normal.x(), s.normal.y(), s.radius);
  };
  std::sort(surfels.begin(), surfels.end(), [&](const Surfel& a, const Surfel& b) { return key(a) < key(b); });
  return surfels;
}

/// Are the surfels the same except for their ids?
testing::AssertionResult same_but_ids(std::vector<Surfel> a, std::vector<Surfel> b) {
  for (auto* surfels : {&a, &b}) {
    *surfels = sorted(*surfels);
    for (std::size_t n = 0; n < surfels->size(); ++n) (*surfels)[n].id = static_cast<std::uint32_t>(n);
  }
  return same(a, b);
}

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

class MapperFiles : public testing::Test {
 protected:
  void SetUp() override {
    integrate_all(mapper_, frames_);
    surfels_ = mapper_.surfels();
    ASSERT_GT(surfels_.size(), 10000u);
  }

  std::size_t files() const { return std::distance(fs::directory_iterator(folder_), fs::directory_iterator()); }

  /// Expects that a map cannot be loaded and that the mapper's map and sequence number stay.
  void expect_refused(const std::string& path) {
    const std::string said = fault_of<FileError>([&] { mapper_.load(path); });
    EXPECT_NE(said.find(path), std::string::npos) << "said '" << said << "'";
    EXPECT_TRUE(same(surfels_, mapper_.surfels()));
    EXPECT_EQ(mapper_.sequence(), frames_.size());
  }

  Frames frames_ = orbit_frames(coarse_camera(), 3, 6);
  Mapper mapper_{undecimated()};
  std::vector<Surfel> surfels_;
  const TemporaryFolder temporary_{"maps"};
  const fs::path folder_ = temporary_.path();
  const std::string path_ = (folder_ / "map.ply").string();
};

TEST_F(MapperFiles, ASavedMapComesBack) {
  mapper_.save(path_);
  EXPECT_EQ(files(), 1u);
  EXPECT_TRUE(same(surfels_, mapper_.surfels())) << "saving changes nothing";
  EXPECT_TRUE(std::any_of(surfels_.begin(), surfels_.end(), [](const Surfel& s) { return s.rgb[0] > 0; }));

  Mapper other(undecimated());
  other.load(path_);
  EXPECT_TRUE(same_but_ids(surfels_, other.surfels()));
  EXPECT_TRUE(all_sound(other.surfels()));
  EXPECT_EQ(other.sequence(), 1u);

  mapper_.load(path_);
  EXPECT_TRUE(same(other.surfels(), mapper_.surfels())) << "loading over a map gives the same as loading into an empty one";

  Mapper third(undecimated());
  other.save(path_);
  third.load(path_);
  EXPECT_TRUE(same(other.surfels(), third.surfels())) << "a loaded map keeps its ids when it is saved and loaded again";
}

TEST_F(MapperFiles, TheEndingOfThePathDecidesTheFormat) {
  const std::string pcd = (folder_ / "map.pcd").string();
  mapper_.save(path_);
  mapper_.save(pcd);
  EXPECT_EQ(bytes_of(path_).substr(0, 4), "ply\n");
  EXPECT_EQ(bytes_of(pcd).substr(0, 11), "# .PCD v0.7");
  Mapper from_ply(undecimated()), from_pcd(undecimated());
  from_ply.load(path_);
  from_pcd.load(pcd);
  EXPECT_TRUE(same(from_ply.surfels(), from_pcd.surfels()));

  const std::string other = (folder_ / "map.txt").string();
  const std::string sentence = "The path '" + other + "' of a map must end in .ply or .pcd: give one that does.";
  EXPECT_EQ(fault_of<FileError>([&] { mapper_.save(other); }), sentence);
  EXPECT_EQ(fault_of<FileError>([&] { mapper_.load(other); }), sentence);
  EXPECT_TRUE(same(surfels_, mapper_.surfels()));
}

TEST_F(MapperFiles, LoadingSurfelsIsLikeLoadingAFileOfSurfels) {
  write_map(path_, surfels_);
  Mapper from_file(undecimated());
  from_file.load(path_);
  mapper_.load(surfels_);
  EXPECT_TRUE(same(from_file.surfels(), mapper_.surfels()));
  EXPECT_EQ(mapper_.sequence(), frames_.size() + 1);
  EXPECT_TRUE(mapper_.integrate(frames_.back().view()).view_kept) << "the recent views are forgotten";
  from_file.integrate(frames_.back().view());
  EXPECT_TRUE(same(from_file.surfels(), mapper_.surfels()));
}

/// The next frames change a loaded map in the same way as the map that was saved.
TEST_F(MapperFiles, MappingGoesOnWithALoadedMap) {
  Config config = undecimated();
  config.refine_surfels = false;  // marks of surfels in thin space are not saved
  Mapper through(config), resumed(config);
  Frames plain = orbit_frames(coarse_camera(), 6, 6);
  for (auto& frame : plain) frame.color.release();
  for (int n = 0; n < 3; ++n) through.integrate(plain[n].view());
  through.save(path_);
  resumed.load(path_);
  for (int n = 3; n < 6; ++n) {
    const Report a = through.integrate(plain[n].view()), b = resumed.integrate(plain[n].view());
    EXPECT_EQ(a.created, b.created);
    EXPECT_EQ(a.removed, b.removed);
  }
  EXPECT_TRUE(same_but_ids(through.surfels(), resumed.surfels()));
}

TEST_F(MapperFiles, AnEmptyMapIsAMap) {
  Mapper empty(undecimated());
  empty.save(path_);
  mapper_.load(path_);
  EXPECT_TRUE(mapper_.surfels().empty());
  EXPECT_EQ(mapper_.statistics().surfels, 0u);
  integrate_all(mapper_, frames_);
  EXPECT_TRUE(same(surfels_, mapper_.surfels())) << "the mapper is like a new one";
}

TEST_F(MapperFiles, LoadingReplacesTheRecentViews) {
  mapper_.save(path_);
  mapper_.load(path_);
  EXPECT_FALSE(mapper_.integrate(frames_.back().view()).view_kept) << "the file has them";
  mapper_.load(surfels_);
  EXPECT_TRUE(mapper_.integrate(frames_.back().view()).view_kept);
  EXPECT_FALSE(mapper_.integrate(frames_.back().view()).view_kept) << "the camera has not moved";
  mapper_.reset();
  EXPECT_TRUE(mapper_.integrate(frames_.back().view()).view_kept);
}

TEST_F(MapperFiles, AFileThatIsMissingOrDamagedIsRefused) {
  expect_refused((folder_ / "missing.ply").string());
  expect_refused((folder_ / "no_folder" / "map.ply").string());
  expect_refused(folder_.string());
  mapper_.save(path_);
  const std::string whole = bytes_of(path_);
  const auto put = [&](const std::string& bytes) { std::ofstream(path_, std::ios::binary) << bytes; };
  for (const std::size_t size : {std::size_t{0}, std::size_t{100}, whole.size() / 2, whole.size() - 32, whole.size() - 1}) {
    SCOPED_TRACE("cut off after " + std::to_string(size));
    put(whole.substr(0, size));
    expect_refused(path_);
  }
  for (const std::size_t at : {whole.size() - 1, whole.size() / 2, std::size_t{10}}) {
    SCOPED_TRACE("damaged at " + std::to_string(at));
    std::string damaged = whole;
    damaged[at] ^= 0x40;
    put(damaged);
    expect_refused(path_);
  }
  Mapper untroubled(undecimated());
  integrate_all(untroubled, frames_);
  const auto next = orbit_frames(coarse_camera(), 4, 6).back();
  mapper_.integrate(next.view());
  untroubled.integrate(next.view());
  EXPECT_TRUE(same(untroubled.surfels(), mapper_.surfels()));
}

TEST_F(MapperFiles, SavingToAnUnusablePathIsRefused) {
  for (const fs::path& path : {folder_ / "no_folder" / "map.ply", folder_, fs::path("/dev/full")}) {
    const std::string said = fault_of<FileError>([&] { mapper_.save(path.string()); });
    EXPECT_NE(said.find(path.string()), std::string::npos) << "said '" << said << "'";
  }
  EXPECT_EQ(files(), 0u) << "nothing is left behind";
  EXPECT_TRUE(same(surfels_, mapper_.surfels()));
}

TEST_F(MapperFiles, AFullDiskKeepsTheOldFile) {
  const fs::path disk = folder_ / "disk";
  fs::create_directory(disk);
  if (mount("none", disk.c_str(), "tmpfs", 0, "size=64k") != 0)
    GTEST_SKIP() << "A small disk cannot be mounted here (" << std::strerror(errno) << "): run as root to test a full disk.";
  const std::string path = (disk / "map.ply").string();
  Mapper(undecimated()).save(path);
  const std::string old = bytes_of(path);
  const std::string said = fault_of<FileError>([&] { mapper_.save(path); });
  EXPECT_NE(said.find(path), std::string::npos) << "said '" << said << "'";
  EXPECT_EQ(bytes_of(path), old);
  EXPECT_EQ(std::distance(fs::directory_iterator(disk), fs::directory_iterator()), 1) << "a temporary file is left behind";
  umount(disk.c_str());
}

TEST_F(MapperFiles, AReadOnlyFolderKeepsTheOldFile) {
  if (geteuid() == 0) GTEST_SKIP() << "Root may write into any folder: run as another user to test a read-only folder.";
  Mapper(undecimated()).save(path_);
  const std::string old = bytes_of(path_);
  fs::permissions(folder_, fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THROW(mapper_.save(path_), FileError);
  fs::permissions(folder_, fs::perms::owner_all);
  EXPECT_EQ(bytes_of(path_), old);
}

TEST_F(MapperFiles, ResetEmptiesTheMap) {
  mapper_.reset();
  EXPECT_TRUE(mapper_.surfels().empty());
  EXPECT_EQ(mapper_.sequence(), frames_.size() + 1) << "the sequence number goes on";
  EXPECT_EQ(mapper_.statistics().surfels, 0u);
  const std::vector<std::uint32_t> told = mapper_.changes(frames_.size()).removed;
  const std::set<std::uint32_t> removed(told.begin(), told.end());
  EXPECT_TRUE(std::all_of(surfels_.begin(), surfels_.end(), [&](const Surfel& s) { return removed.count(s.id) == 1; }));
  mapper_.reset();
  EXPECT_TRUE(mapper_.surfels().empty());
}

TEST_F(MapperFiles, StatisticsFitTheMap) {
  const Statistics statistics = mapper_.statistics();
  const auto occupied = static_cast<std::size_t>(
      std::count_if(surfels_.begin(), surfels_.end(), [](const Surfel& s) { return s.label == Label::kOccupied; }));
  EXPECT_EQ(statistics.surfels, surfels_.size());
  EXPECT_EQ(statistics.occupied, occupied);
  EXPECT_EQ(statistics.frontier, surfels_.size() - occupied);
  EXPECT_GT(occupied, 1000u);
  EXPECT_LT(occupied, surfels_.size());

  // A surfel takes 16 bytes; spare capacity must not be many times as much.
  EXPECT_GE(statistics.map_bytes, 16 * surfels_.size());
  EXPECT_LT(statistics.map_bytes, 200 * surfels_.size());
  EXPECT_GT(statistics.device_bytes, statistics.map_bytes);
  EXPECT_LT(statistics.device_bytes, std::size_t{500} << 20) << "for a grid of 90 x 70 x 187 voxels";

  Mapper empty(undecimated());
  EXPECT_EQ(empty.statistics().surfels, 0u);
  EXPECT_LT(empty.statistics().device_bytes, statistics.device_bytes);
}

TEST_F(MapperFiles, RepeatedResetsDoNotAddMemory) {
  std::size_t bytes[6];
  for (std::size_t& now : bytes) {
    mapper_.reset();
    integrate_all(mapper_, frames_);
    now = mapper_.statistics().device_bytes;
  }
  EXPECT_EQ(bytes[1], bytes[5]);
}

}  // namespace
}  // namespace frontier_surfels
