#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>
#include <thread>

#include "frontier_surfels/ply.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::vector<Surfel> some_surfels(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> number(-5, 5);
  std::vector<Surfel> surfels(count);
  for (Surfel& s : surfels) {
    s.position = {number(random), number(random), number(random)};
    s.normal = Eigen::Vector3f(number(random), number(random), number(random)).normalized();
    s.radius = 0.01f + std::abs(number(random));
    s.label = random() % 2 ? Label::kOccupied : Label::kFrontier;
    s.rgb = {static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random())};
    s.id = 1000000 + random() % 1000;
  }
  return surfels;
}

void expect_equal(const std::vector<Surfel>& a, const std::vector<Surfel>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].position, b[i].position);
    EXPECT_EQ(a[i].normal, b[i].normal);
    EXPECT_EQ(a[i].radius, b[i].radius);
    EXPECT_EQ(a[i].label, b[i].label);
    EXPECT_EQ(a[i].rgb, b[i].rgb);
    EXPECT_EQ(b[i].id, i);
  }
}

/// A folder of its own for every test.
class Ply : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "ply_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    path_ = (folder_ / "map.ply").string();
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::size_t files() const { return std::distance(fs::directory_iterator(folder_), fs::directory_iterator()); }

  std::string bytes() const {
    std::ifstream file(path_, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }
  void put(const std::string& bytes) const { std::ofstream(path_, std::ios::binary) << bytes; }

  /// What read_ply says of a file of these bytes; "" if it takes it.
  std::string fault(const std::string& bytes) const {
    put(bytes);
    try {
      read_ply(path_);
    } catch (const FileError& e) {
      return e.what();
    }
    return "";
  }

  std::string write_fault(const std::string& path, const std::vector<Surfel>& surfels) const {
    try {
      write_ply(path, surfels);
    } catch (const FileError& e) {
      return e.what();
    }
    return "";
  }

  fs::path folder_;
  std::string path_;
};

TEST_F(Ply, RoundTripIsExact) {
  for (const std::size_t count : {0u, 1u, 2u, 1000u}) {
    const std::vector<Surfel> surfels = some_surfels(count);
    write_ply(path_, surfels);
    expect_equal(surfels, read_ply(path_));
    EXPECT_EQ(files(), 1u) << "a temporary file was left behind";
  }
}

TEST_F(Ply, LayoutIsWhatOtherProgramsExpect) {
  Surfel s;
  s.position = {1, 2, 3};
  s.normal = {0, 0, -1};
  s.radius = 0.5f;
  s.label = Label::kOccupied;
  s.rgb = {10, 20, 30};
  write_ply(path_, {s});
  const std::string file = bytes();
  const std::size_t end = file.find("end_header\n") + 11;
  std::string header = file.substr(0, end);
  const std::size_t crc = header.find("crc32 ") + 6;
  header.replace(crc, 8, "XXXXXXXX");
  EXPECT_EQ(header,
            "ply\nformat binary_little_endian 1.0\ncomment frontier_surfels 1 crc32 XXXXXXXX\nelement vertex 1\n"
            "property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
            "property float radius\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar label\nend_header\n");
  const float numbers[] = {1, 2, 3, 0, 0, -1, 0.5f};
  ASSERT_EQ(file.size(), end + 32);
  EXPECT_EQ(std::memcmp(file.data() + end, numbers, sizeof numbers), 0);
  EXPECT_EQ(file.substr(end + 28), std::string("\x0a\x14\x1e\x01"));
}

TEST_F(Ply, ReplacesAnOldFileAndFollowsALink) {
  const fs::path link = folder_ / "link.ply";
  write_ply(path_, some_surfels(5));
  fs::create_symlink(path_, link);
  write_ply(link.string(), some_surfels(9));
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(read_ply(path_).size(), 9u);
  EXPECT_EQ(files(), 2u);
}

TEST_F(Ply, AnyTruncationIsRefused) {
  write_ply(path_, some_surfels(3));
  const std::string whole = bytes();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::string said = fault(whole.substr(0, size));
    EXPECT_TRUE(contains(said, "cut off")) << size << " of " << whole.size() << ": " << said;
    EXPECT_TRUE(contains(said, path_)) << said;
  }
  EXPECT_TRUE(contains(fault(whole + "x"), "too long"));
  EXPECT_TRUE(contains(fault(whole + std::string(32, 'x')), "too long"));
}

TEST_F(Ply, AnyFlippedBitIsRefused) {
  write_ply(path_, some_surfels(2));
  const std::string whole = bytes();
  for (std::size_t byte = 0; byte < whole.size(); ++byte) {
    const int bit = static_cast<int>(byte * 5 % 8);  // one of each byte, for time
    std::string damaged = whole;
    damaged[byte] = static_cast<char>(damaged[byte] ^ (1 << bit));
    EXPECT_NE(fault(damaged), "") << "bit " << bit << " of byte " << byte;
  }
}

TEST_F(Ply, LyingCountAsksForNoMemory) {
  write_ply(path_, some_surfels(2));
  for (const char* count : {"4294967296", "18446744073709551615", "99999999999999999999999", "-1", "576460752303423490"}) {
    std::string file = bytes();
    file.replace(file.find("vertex 2") + 7, 1, count);
    put(file);
    EXPECT_THROW(read_ply(path_), FileError) << count;  // not bad_alloc, not length_error
    write_ply(path_, some_surfels(2));
  }
}

TEST_F(Ply, ForeignFilesAreRefused) {
  EXPECT_TRUE(contains(fault("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n"), "another layout"));
  EXPECT_TRUE(contains(fault(std::string(100000, '\0')), "no saved map"));
  EXPECT_TRUE(contains(fault("end_header\n"), "another layout"));
  EXPECT_THROW(read_ply(folder_.string()), FileError);
  EXPECT_THROW(read_ply("/dev/zero"), FileError);
  try {
    read_ply(path_ + ".missing");
    FAIL();
  } catch (const FileError& e) {
    EXPECT_EQ(std::string(e.what()), "The map " + path_ + ".missing cannot be read: No such file or directory.");
  }
}

TEST_F(Ply, UnsoundSurfelsAreNotWritten) {
  write_ply(path_, some_surfels(4));
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    for (int field = 0; field < 7; ++field) {
      std::vector<Surfel> surfels = some_surfels(3);
      (field < 3 ? surfels[1].position[field] : field < 6 ? surfels[1].normal[field - 3] : surfels[1].radius) = bad;
      EXPECT_TRUE(contains(write_fault(path_, surfels), "surfel 1 ")) << field;
    }
  }
  EXPECT_EQ(read_ply(path_).size(), 4u) << "the old file is gone";
  EXPECT_EQ(files(), 1u);
}

TEST_F(Ply, WriteErrorsNameThePathAndTheReason) {
  const std::string nowhere = (folder_ / "no" / "map.ply").string();
  EXPECT_EQ(write_fault(nowhere, some_surfels(1)), "The map cannot be written to " + nowhere + ": No such file or directory.");
  EXPECT_TRUE(contains(write_fault(folder_.string(), some_surfels(1)), "no ordinary file"));
  EXPECT_TRUE(contains(write_fault("/dev/full", some_surfels(1)), "no ordinary file"));
  struct stat device;
  ASSERT_EQ(stat("/dev/full", &device), 0);
  EXPECT_TRUE(S_ISCHR(device.st_mode)) << "a device was replaced by a file";
  EXPECT_NE(write_fault("", some_surfels(1)), "");
}

TEST_F(Ply, FailureHalfWayKeepsTheOldFile) {
  const std::vector<Surfel> old = some_surfels(10);
  write_ply(path_, old);
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small = {20000, before.rlim_max};
  std::signal(SIGXFSZ, SIG_IGN);  // the write fails instead
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string said = write_fault(path_, some_surfels(10000));
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(said, "The map cannot be written to " + path_ + ": File too large.");
  EXPECT_EQ(files(), 1u) << "the temporary file was left behind";
  expect_equal(old, read_ply(path_));
}

TEST_F(Ply, FullDiskKeepsTheOldFile) {
  const fs::path disk = folder_ / "disk";
  fs::create_directory(disk);
  if (mount("none", disk.c_str(), "tmpfs", 0, "size=64k") != 0) {
    GTEST_SKIP() << "A small disk cannot be mounted here (" << std::strerror(errno) << "): run as root to test a full one.";
  }
  const std::string path = (disk / "map.ply").string();
  const std::vector<Surfel> old = some_surfels(100);
  write_ply(path, old);
  const std::string said = write_fault(path, some_surfels(10000));
  const auto left = std::distance(fs::directory_iterator(disk), fs::directory_iterator());
  const std::vector<Surfel> now = read_ply(path);
  umount(disk.c_str());
  EXPECT_EQ(said, "The map cannot be written to " + path + ": No space left on device.");
  EXPECT_EQ(left, 1);
  expect_equal(old, now);
}

TEST_F(Ply, ThreadsMaySaveToTheSameFile) {
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 5; ++i) write_ply(path_, some_surfels(100 + t));
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::size_t count = read_ply(path_).size();
  EXPECT_GE(count, 100u);
  EXPECT_LT(count, 108u);
  EXPECT_EQ(files(), 1u);
}

}  // namespace
}  // namespace frontier_surfels
