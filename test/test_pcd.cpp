/// What is particular to PCD files; test_map_files.cpp has what both formats share, and test_pcl.cpp what PCL makes of them.
#include <cstring>
#include <locale>

#include "frontier_surfels/pcd.hpp"
#include "map_file_input.hpp"

namespace frontier_surfels {
namespace {

class Pcd : public MapFileFolder {
 protected:
  Pcd() : MapFileFolder(".pcd") {}

  std::vector<Surfel> read(const std::string& bytes) const {
    put(bytes);
    return read_pcd(path_);
  }
};

/// A text with the n-th of these lines replaced.
std::string file_with(const std::string& line, const std::string& by) {
  std::string text =
      "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z normal_x normal_y normal_z radius label\n"
      "SIZE 4 4 4 4 4 4 4 4\nTYPE F F F F F F F U\nCOUNT 1 1 1 1 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n"
      "DATA ascii\n1 2 3 0 0 1 0.25 1\n-1.5 2e-3 +3 1 0 0 0.5 0\n";
  const std::size_t at = text.find(line);
  EXPECT_NE(at, std::string::npos) << line;
  return text.replace(at, line.size(), by);
}

TEST_F(Pcd, LayoutIsWhatOtherProgramsExpect) {
  Surfel occupied;
  occupied.position = {1, 2, 3};
  occupied.normal = {0, 0, -1};
  occupied.radius = 0.5f;
  occupied.label = Label::kOccupied;
  occupied.rgb = {10, 20, 30};
  occupied.id = 7;
  Surfel frontier = occupied;
  frontier.label = Label::kFrontier;
  frontier.rgb = {0, 0, 0};
  write_pcd(path_, {occupied, frontier});
  const std::string file = bytes();
  const std::size_t end = file.find("DATA binary\n") + 12;
  std::string header = file.substr(0, end);
  header.replace(header.find("crc32 ") + 6, 8, "XXXXXXXX");
  EXPECT_EQ(header,
            "# .PCD v0.7 - Point Cloud Data file format\n# frontier_surfels 1 crc32 XXXXXXXX\nVERSION 0.7\n"
            "FIELDS x y z normal_x normal_y normal_z rgb radius confidence curvature label id\nSIZE 4 4 4 4 4 4 4 4 4 4 4 4\n"
            "TYPE F F F F F F F F F F U U\nCOUNT 1 1 1 1 1 1 1 1 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n"
            "DATA binary\n");
  ASSERT_EQ(file.size(), end + 2 * 48);
  const float numbers[] = {1, 2, 3, 0, 0, -1};
  const auto floats = [&](std::size_t at) {
    float value;
    std::memcpy(&value, file.data() + end + at, sizeof value);
    return value;
  };
  EXPECT_EQ(std::memcmp(file.data() + end, numbers, sizeof numbers), 0);
  EXPECT_EQ(file.substr(end + 24, 4), std::string("\x1e\x14\x0a\0", 4)) << "its own colour: blue, green, red, 0";
  EXPECT_EQ(file.substr(end + 48 + 24, 4), std::string("\xff\0\0\x01", 4)) << "that of frontier, marked";
  EXPECT_EQ(floats(28), 0.5f);
  EXPECT_EQ(floats(32), 0) << "occupied: known for sure";
  EXPECT_EQ(floats(48 + 32), 1) << "frontier";
  EXPECT_EQ(file.substr(end + 40, 8), std::string("\1\0\0\0\7\0\0\0", 8));
}

TEST_F(Pcd, TextIsRead) {
  const std::vector<Surfel> surfels = read(file_with("", ""));
  ASSERT_EQ(surfels.size(), 2u);
  EXPECT_EQ(surfels[0].position, Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(surfels[0].radius, 0.25f);
  EXPECT_EQ(surfels[0].label, Label::kOccupied);
  EXPECT_EQ(surfels[1].position, Eigen::Vector3f(-1.5f, 2e-3f, 3));
  EXPECT_EQ(surfels[1].normal, Eigen::Vector3f(1, 0, 0));
  EXPECT_EQ(surfels[1].label, Label::kFrontier);
  EXPECT_EQ(surfels[1].rgb, (std::array<std::uint8_t, 3>{0, 0, 0})) << "without a colour in the file";
  EXPECT_EQ(surfels[1].id, 1u);
}

TEST_F(Pcd, OtherFieldsAndOrdersAreRead) {
  const std::string fields = "FIELDS label big _ confidence radius normal_z normal_y normal_x z y x rgba\n";
  const std::string sizes = "SIZE 1 8 1 4 4 4 4 4 4 4 4 4\nTYPE U F U F F F F F F F F U\nCOUNT 1 2 3 1 1 1 1 1 1 1 1 1\n";
  put("VERSION 0.7\n" + fields + sizes + "WIDTH 1\nHEIGHT 1\nDATA ascii\n1 1e300 2 3 4 5 9 0.5 3 2 1 30 20 10 4278190335\n");
  const Surfel s = read_pcd(path_).at(0);
  EXPECT_EQ(s.position, Eigen::Vector3f(10, 20, 30));
  EXPECT_EQ(s.normal, Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(s.radius, 0.5f);
  EXPECT_EQ(s.label, Label::kOccupied) << "label counts more than confidence";
  EXPECT_EQ(s.rgb, (std::array<std::uint8_t, 3>{0, 0, 255})) << "opaque: its own colour";
}

TEST_F(Pcd, ConfidenceTellsWhereThereIsNoLabel) {
  std::string text = file_with("radius label", "radius confidence");
  text.replace(text.find("F U\n"), 4, "F F\n");
  const std::vector<Surfel> surfels = read(text);
  EXPECT_EQ(surfels.at(0).label, Label::kFrontier);
  EXPECT_EQ(surfels.at(1).label, Label::kOccupied);
}

/// A country that writes 0,25.
struct Comma : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
};

TEST_F(Pcd, NumbersDoNotDependOnTheLocale) {
  const std::string text = file_with("", "");
  const std::locale before = std::locale::global(std::locale(std::locale(), new Comma));
  const std::vector<Surfel> surfels = read(text);
  std::locale::global(before);
  EXPECT_EQ(surfels.at(0).radius, 0.25f);
}

TEST_F(Pcd, WhatIsNoMapIsRefusedWithItsReason) {
  const auto said = [&](const std::string& line, const std::string& by) { return fault(file_with(line, by)); };
  EXPECT_EQ(said("", ""), "");
  EXPECT_EQ(said("DATA ascii", "DATA binary_compressed"),
            path_ + " is compressed (DATA binary_compressed), which cannot be read: save it with DATA binary.");
  EXPECT_EQ(said("normal_z radius", "normal_z size"),
            path_ + " has no field radius, which surfels need: give a file that was saved as surfels.");
  EXPECT_EQ(said("FIELDS x", "FIELDS X"), path_ + " has no field x, which surfels need: give a file that was saved as surfels.");
  EXPECT_TRUE(contains(said("radius label", "radius labels"), "neither a field label nor confidence"));
  EXPECT_TRUE(contains(said("SIZE 4 4 4", "SIZE 8 4 4"), "field x of another type"));
  EXPECT_TRUE(contains(said("TYPE F", "TYPE U"), "field x of another type"));
  EXPECT_TRUE(contains(said("COUNT 1 1 1", "COUNT 1 3 1"), "field y of another type"));
  EXPECT_TRUE(contains(said("F F U\n", "F F F\n"), "field label of another type"));
  EXPECT_TRUE(contains(said("0.25 1\n", "0.25 2\n"), "unknown label"));
  EXPECT_TRUE(contains(said("0.25 1\n", "0 1\n"), "without radius"));
  EXPECT_TRUE(contains(said("0.25 1\n", "nan 1\n"), "point 0 has a value of field radius that is no finite number"));
  EXPECT_TRUE(contains(said("0.5 0\n", "0.5\n"), "point 1 has a value of field label"));
  EXPECT_TRUE(contains(said("-1.5 2e-3 +3 1 0 0 0.5 0\n", ""), "cut off or too long"));
  EXPECT_TRUE(contains(said("DATA ascii", "DATA binary"), "cut off or too long"));
}

TEST_F(Pcd, HeadersThatMakeNoSenseAreRefused) {
  const std::pair<const char*, const char*> changes[] = {{"DATA ascii", "DATA binary_big"},
                                                         {"DATA ascii", "DATA"},
                                                         {"SIZE 4", "SIZE 3"},
                                                         {"SIZE 4", "SIZE"},
                                                         {"SIZE 4", "SIZE -4"},
                                                         {"SIZE 4", "SIZE 99999999999999999999"},
                                                         {"COUNT 1", "COUNT 4294967296"},
                                                         {"COUNT 1", "COUNT 1 1"},
                                                         {"COUNT 1", "COUNT x"},
                                                         {"TYPE F", "TYPE D"},
                                                         {"TYPE F F", "TYPE F"},
                                                         {"FIELDS x", "FIELDS"},
                                                         {"FIELDS x", "FIELDS x x"},
                                                         {"WIDTH 2", "WIDTH"},
                                                         {"WIDTH 2", "WIDTH 2 2"},
                                                         {"WIDTH 2", "WIDTH -2"},
                                                         {"WIDTH 2", "WIDTH 4294967298"},
                                                         {"HEIGHT 1", "HEIGHT 2"},
                                                         {"HEIGHT 1\n", ""},
                                                         {"POINTS 2", "POINTS 1"},
                                                         {"POINTS 2", "POINTS"},
                                                         {"POINTS 2", "POINTS 18446744073709551618"}};
  for (const auto& [line, by] : changes) EXPECT_NE(fault(file_with(line, by)), "") << line << " -> " << by;
}

TEST_F(Pcd, LyingCountAsksForNoMemory) {
  write_pcd(path_, some_surfels(2));
  std::string file = bytes();
  for (const char* line : {"WIDTH 2", "POINTS 2"})
    file.replace(file.find(line), std::strlen(line), std::string(line, std::strlen(line) - 1) + "4000000000");
  EXPECT_TRUE(contains(fault(file), "cut off")) << "200 GB";
  EXPECT_TRUE(contains(fault(file.replace(file.find("binary"), 6, "ascii")), "damaged"));
}

/// Files with random bytes, words and lines changed, of all kinds: they are refused or read, and nothing else happens.
TEST_F(Pcd, RandomDamageNeverCrashes) {
  std::mt19937 random(1);
  write_pcd(path_, some_surfels(5));
  const std::string ours = bytes(), text = file_with("", ""),
                    foreign = ours.substr(0, ours.find("# fr")) + ours.substr(ours.find("VERSION"));
  const char* words[] = {"0", "-1", "1", "4", "8", "65536", "4294967295", "1e99", "nan", "x", "label", "rgb", "F", "U", "\n", " ", "ascii"};
  int refused = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    std::string file = trial % 3 == 0 ? ours : trial % 3 == 1 ? text : foreign;
    for (std::size_t changes = 1 + random() % 4; changes > 0; --changes) {
      const std::size_t at = random() % file.size(), length = std::min<std::size_t>(random() % 9, file.size() - at);
      switch (random() % 4) {
        case 0:
          file[at] = static_cast<char>(random());
          break;
        case 1:
          file.replace(at, length, words[random() % std::size(words)]);
          break;
        case 2:
          file.insert(at, file.substr(random() % file.size(), length));
          break;
        default:
          file.erase(at, length);
          break;
      }
      if (file.empty()) file = "x";
    }
    refused += fault(file) != "";
  }
  EXPECT_GT(refused, 700);
}

}  // namespace
}  // namespace frontier_surfels
