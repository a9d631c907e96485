/// What is particular to PLY files; test_map_files.cpp has what both formats share.
#include <cstring>

#include "frontier_surfels/ply.hpp"
#include "map_file_input.hpp"

namespace frontier_surfels {
namespace {

class Ply : public MapFileFolder {
 protected:
  Ply() : MapFileFolder(".ply") {}
};

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
  EXPECT_TRUE(contains(fault("end_header\n"), "another layout"));
}

TEST_F(Ply, ThePathsEndingDoesNotMatter) {
  write_ply((folder_ / "map").string(), some_surfels(3));
  EXPECT_EQ(read_ply((folder_ / "map").string()).size(), 3u);
}

}  // namespace
}  // namespace frontier_surfels
