/// Saved maps of both formats: whatever happens, a file is whole or refused.
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <limits>
#include <thread>

#include "map_file_input.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

class MapFiles : public MapFileFolder, public testing::WithParamInterface<const char*> {
 protected:
  MapFiles() : MapFileFolder(GetParam()) {}

  std::string write_fault(const std::string& path, const std::vector<Surfel>& surfels) const {
    return file_fault([&] { write_map(path, surfels); });
  }
};

INSTANTIATE_TEST_SUITE_P(Formats, MapFiles, testing::Values(".ply", ".pcd"),
                         [](const auto& test) { return std::string(test.param).substr(1); });

TEST_P(MapFiles, RoundTripIsExact) {
  for (const std::size_t count : {0u, 1u, 2u, 1000u}) {
    const std::vector<Surfel> surfels = some_surfels(count);
    write_map(path_, surfels);
    EXPECT_TRUE(same_but_ids(surfels, read_map(path_)));
    EXPECT_EQ(files(), 1u) << "a temporary file was left behind";
  }
}

/// The colours that are shown in place of none are colours like others where a surfel has them itself.
TEST_P(MapFiles, EveryColourComesBack) {
  std::vector<Surfel> surfels;
  for (const std::array<std::uint8_t, 3> rgb :
       {std::array<std::uint8_t, 3>{0, 0, 0}, {0, 0, 255}, {128, 128, 128}, {255, 255, 255}, {0, 0, 1}})
    for (const Label label : {Label::kFrontier, Label::kOccupied}) {
      surfels.push_back(some_surfels(1).front());
      surfels.back().rgb = rgb;
      surfels.back().label = label;
    }
  write_map(path_, surfels);
  EXPECT_TRUE(same_but_ids(surfels, read_map(path_)));
}

TEST_P(MapFiles, ReplacesAnOldFileAndFollowsALink) {
  const fs::path link = folder_ / ("link" + ending_);
  write_map(path_, some_surfels(5));
  fs::create_symlink(path_, link);
  write_map(link.string(), some_surfels(9));
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(read_map(path_).size(), 9u);
  EXPECT_EQ(files(), 2u);
}

TEST_P(MapFiles, TheEndingMayBeInCapitals) {
  const std::string path = (folder_ / (ending_ == ".ply" ? "MAP.PLY" : "MAP.PCD")).string();
  write_map(path, some_surfels(3));
  fs::rename(path, path_);
  EXPECT_EQ(read_map(path_).size(), 3u);
}

TEST_P(MapFiles, AnotherEndingIsRefusedBeforeAnythingIsWritten) {
  for (const char* name : {"map", "map.txt", "map.ply.old", "pcd", ".pcd", "map.", "folder.pcd/map"}) {
    const std::string path = (folder_ / name).string();
    const std::string sentence = "The path '" + path + "' of a map must end in .ply or .pcd: give one that does.";
    EXPECT_EQ(write_fault(path, some_surfels(1)), sentence);
    EXPECT_EQ(file_fault([&] { read_map(path); }), sentence);
  }
  EXPECT_EQ(files(), 0u);
}

TEST_P(MapFiles, AnyTruncationIsRefused) {
  write_map(path_, some_surfels(3));
  const std::string whole = bytes();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::string said = fault(whole.substr(0, size));
    EXPECT_TRUE(contains(said, "cut off")) << size << " of " << whole.size() << ": " << said;
    EXPECT_TRUE(contains(said, path_)) << said;
  }
  EXPECT_TRUE(contains(fault(whole + "x"), "too long"));
  EXPECT_TRUE(contains(fault(whole + std::string(32, 'x')), "too long"));
  EXPECT_TRUE(contains(fault(whole + std::string(48, 'x')), "too long"));
}

/// In the comment of a PCD file, a bit may change without changing the map.
TEST_P(MapFiles, AnyFlippedBitIsRefusedOrHarmless) {
  const std::vector<Surfel> surfels = some_surfels(2);
  write_map(path_, surfels);
  const std::string whole = bytes();
  std::size_t harmless = 0;
  for (std::size_t bit = 0; bit < 8 * whole.size(); bit += 3) {  // some of each byte, for time
    std::string damaged = whole;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
    if (fault(damaged) != "") continue;
    ++harmless;
    EXPECT_TRUE(same_but_ids(surfels, read_map(path_))) << "bit " << bit % 8 << " of byte " << bit / 8;
  }
  EXPECT_LE(harmless, ending_ == ".ply" ? 0 : 3 * whole.find("VERSION"));
}

TEST_P(MapFiles, WhatCannotBeReadIsRefused) {
  EXPECT_TRUE(contains(fault(std::string(100000, '\0')), ending_ == ".ply" ? "no saved map" : "no PCD file"));
  EXPECT_NE(fault("a letter to a friend"), "");
  fs::remove(path_);
  EXPECT_EQ(file_fault([&] { read_map(path_); }), "The map " + path_ + " cannot be read: No such file or directory.");
  fs::create_directory(path_);
  EXPECT_EQ(file_fault([&] { read_map(path_); }), "The map " + path_ + " cannot be read: Is a directory.");
  const fs::path device = folder_ / ("device" + ending_);
  fs::create_symlink("/dev/zero", device);
  EXPECT_NE(file_fault([&] { read_map(device.string()); }), "");
}

TEST_P(MapFiles, UnsoundSurfelsAreNotWritten) {
  write_map(path_, some_surfels(4));
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    for (int field = 0; field < 7; ++field) {
      std::vector<Surfel> surfels = some_surfels(3);
      (field < 3 ? surfels[1].position[field] : field < 6 ? surfels[1].normal[field - 3] : surfels[1].radius) = bad;
      EXPECT_TRUE(contains(write_fault(path_, surfels), "surfel 1 ")) << field;
    }
  }
  EXPECT_EQ(read_map(path_).size(), 4u) << "the old file is gone";
  EXPECT_EQ(files(), 1u);
}

TEST_P(MapFiles, WriteErrorsNameThePathAndTheReason) {
  const std::string nowhere = (folder_ / "no" / ("map" + ending_)).string();
  EXPECT_EQ(write_fault(nowhere, some_surfels(1)), "The map cannot be written to " + nowhere + ": No such file or directory.");
  fs::create_directory(path_);
  EXPECT_TRUE(contains(write_fault(path_, some_surfels(1)), "it is a folder; give the name of a file."));
  const fs::path device = folder_ / ("device" + ending_);
  fs::create_symlink("/dev/full", device);
  EXPECT_TRUE(contains(write_fault(device.string(), some_surfels(1)), "no ordinary file"));
  struct stat status;
  ASSERT_EQ(stat("/dev/full", &status), 0);
  EXPECT_TRUE(S_ISCHR(status.st_mode)) << "a device was replaced by a file";
}

TEST_P(MapFiles, NamesMayBeAsLongAsTheFileSystemTakes) {
  const std::string longest = (folder_ / (std::string(255 - ending_.size(), 'm') + ending_)).string();
  write_map(longest, some_surfels(3));
  EXPECT_EQ(read_map(longest).size(), 3u);
  const std::string longer = (folder_ / (std::string(300, 'm') + ending_)).string();
  const std::string reason = "a file system takes no name as long as that (most take 255 bytes); give a shorter one.";
  EXPECT_EQ(write_fault(longer, some_surfels(3)), "The map cannot be written to " + longer + ": " + reason);
  EXPECT_EQ(file_fault([&] { read_map(longer); }), "The map " + longer + " cannot be read: " + reason);
  EXPECT_EQ(files(), 1u);
}

TEST_P(MapFiles, FailureHalfWayKeepsTheOldFile) {
  const std::vector<Surfel> old = some_surfels(10);
  write_map(path_, old);
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small = {20000, before.rlim_max};
  std::signal(SIGXFSZ, SIG_IGN);  // the write fails instead
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string said = write_fault(path_, some_surfels(10000));
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(said, "The map cannot be written to " + path_ + ": File too large.");
  EXPECT_EQ(files(), 1u) << "the temporary file was left behind";
  EXPECT_TRUE(same_but_ids(old, read_map(path_)));
}

TEST_P(MapFiles, FullDiskKeepsTheOldFile) {
  const fs::path disk = folder_ / "disk";
  fs::create_directory(disk);
  if (mount("none", disk.c_str(), "tmpfs", 0, "size=64k") != 0) {
    GTEST_SKIP() << "A small disk cannot be mounted here (" << std::strerror(errno) << "): run as root to test a full one.";
  }
  const std::string path = (disk / ("map" + ending_)).string();
  const std::vector<Surfel> old = some_surfels(100);
  write_map(path, old);
  const std::string said = write_fault(path, some_surfels(10000));
  const auto left = std::distance(fs::directory_iterator(disk), fs::directory_iterator());
  const std::vector<Surfel> now = read_map(path);
  umount(disk.c_str());
  EXPECT_EQ(said, "The map cannot be written to " + path + ": No space left on device.");
  EXPECT_EQ(left, 1);
  EXPECT_TRUE(same_but_ids(old, now));
}

TEST_P(MapFiles, ThreadsMaySaveToTheSameFile) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 5; ++i) write_map(path_, some_surfels(100 + t));
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::size_t count = read_map(path_).size();
  EXPECT_GE(count, 100u);
  EXPECT_LT(count, 108u);
  EXPECT_EQ(files(), 1u);
}

}  // namespace
}  // namespace frontier_surfels
