/// Saved maps and configurations with bytes damaged at random: never a crash, always a content or a sentence.
#include <gtest/gtest.h>

#include "frontier_surfels/config.hpp"
#include "map/surfel_file.hpp"
#include "map_file_input.hpp"
#include "random_bytes.hpp"

namespace frontier_surfels {
namespace {

constexpr int kUsual = 5000;

class DamagedFiles : public MapFileFolder {
 protected:
  DamagedFiles() : MapFileFolder("") {}
  void SetUp() override { limit_memory(true); }  // a header may promise more surfels than fit
  void TearDown() override { limit_memory(false); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  template <typename Read>
  void read_damaged(const std::string& name, const std::string& intact, Read read) const {
    write_bytes(path(name), intact);
    read(path(name));
    expect_sentences(random_inputs(kUsual), [&](Damage& damage) {
      write_bytes(path(name), damage(intact));
      read(path(name));
    });
  }

  static void expect_sound(const std::vector<Surfel>& surfels) {
    for (const Surfel& surfel : surfels) {
      ASSERT_TRUE(surfel.position.allFinite() && surfel.normal.allFinite());
      ASSERT_TRUE(std::isfinite(surfel.radius) && surfel.radius > 0);
    }
  }

  /// The few surfels of such a map are not much larger than its header, so that both are damaged.
  std::string map_bytes(const std::string& name) const {
    write_map(path(name), some_surfels(8));
    return read_bytes(path(name));
  }

  /// Without the checksum that would refuse most damage: as files of other programs are.
  static std::string without_checksum(std::string bytes) {
    const std::size_t word = bytes.find("crc32"), begin = bytes.rfind('\n', word) + 1;
    EXPECT_NE(word, std::string::npos);
    return bytes.erase(begin, bytes.find('\n', word) + 1 - begin);
  }

  static void read_surfels(const std::string& file) { expect_sound(read_map(file)); }
};

TEST_F(DamagedFiles, Ply) { read_damaged("map.ply", map_bytes("map.ply"), read_surfels); }

/// A file of ours needs its checksum: here it is that of the damaged surfels.
TEST_F(DamagedFiles, PlyWithTheChecksumOfWhatItHas) {
  const std::string intact = map_bytes("map.ply");
  const std::size_t body = intact.find("end_header\n") + 11, crc = intact.find("crc32 ") + 6;
  expect_sentences(random_inputs(kUsual), [&](Damage& damage) {
    const std::string damaged = damage(intact.substr(body));
    char text[9];
    std::snprintf(text, sizeof(text), "%08x", checksum(damaged.data(), damaged.size()));
    write_bytes(path("map.ply"), std::string(intact, 0, body).replace(crc, 8, text) + damaged);
    read_surfels(path("map.ply"));
  });
}

TEST_F(DamagedFiles, Pcd) { read_damaged("map.pcd", map_bytes("map.pcd"), read_surfels); }

TEST_F(DamagedFiles, PcdWithoutChecksum) { read_damaged("map.pcd", without_checksum(map_bytes("map.pcd")), read_surfels); }

TEST_F(DamagedFiles, PcdOfText) {
  const std::string text =
      "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z normal_x normal_y normal_z radius label\n"
      "SIZE 4 4 4 4 4 4 4 4\nTYPE F F F F F F F U\nCOUNT 1 1 1 1 1 1 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA "
      "ascii\n"
      "0.5 -1.25 2 0 0 1 0.02 1\n1.5 1.75 2 0 0.6 -0.8 0.02 0\n-0.5 4 2e-3 1 0 0 0.02 1\n";
  read_damaged("map.pcd", text, read_surfels);
}

TEST_F(DamagedFiles, Configuration) {
  const auto read = [](const std::string& file) {
    const Config config = load_config(file);
    if (!config.problems().empty()) throw Error(config.problems().front());
  };
  read_damaged("config.yaml", "# of a test\n" + to_yaml(Config()), read);
}

}  // namespace
}  // namespace frontier_surfels
