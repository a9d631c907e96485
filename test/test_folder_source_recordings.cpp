/// Folders with recorded sequences: what is read of them. Skipped without recordings.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "recordings/frame_source.hpp"

namespace fs = std::filesystem;
using namespace frontier_surfels;
using namespace frontier_surfels::replay;

namespace {

/// A recorded sequence, and some of its pixels.
fs::path recorded(const std::string& name) {
  const char* wanted = std::getenv("FRONTIER_SURFELS_DATA");
  return fs::path(wanted ? wanted : FRONTIER_SURFELS_DATA_DIR) / name;
}

struct Expected {
  std::size_t frames;
  double last_stamp;
  Eigen::Vector3d first_position;
  int first_pixel, last_pixel;  ///< row 240, column 320 [mm]
  bool color;
};

void expect_recorded(const fs::path& folder, const Expected& expected) {
  const auto source = open_source(folder.string());
  EXPECT_EQ(source->size(), expected.frames);
  std::vector<RecordedFrame> frames;
  while (auto frame = source->next()) frames.push_back(*frame);
  ASSERT_EQ(frames.size(), expected.frames);
  EXPECT_NEAR(frames.back().stamp, expected.last_stamp, 1e-6);
  EXPECT_EQ(frames.front().T_world_camera.translation(), expected.first_position);
  EXPECT_EQ(frames.front().depth.at<std::uint16_t>(240, 320), expected.first_pixel);
  EXPECT_EQ(frames.back().depth.at<std::uint16_t>(240, 320), expected.last_pixel);
  EXPECT_EQ(!frames.front().color.empty(), expected.color);
}

TEST(RecordedSequences, SevenScenesRedKitchen) {
  const fs::path folder = recorded("7scenes_redkitchen");
  if (!fs::exists(folder)) GTEST_SKIP() << "There is no " << folder << ": set FRONTIER_SURFELS_DATA to the folder of recorded sequences.";
  expect_recorded(folder, {200, 33.166667, {-0.3404563, 0.0164698, 0.2965692}, 1382, 1549, false});
}

TEST(RecordedSequences, TumFr1Xyz) {
  const fs::path folder = recorded("tum_fr1_xyz");
  if (!fs::exists(folder)) GTEST_SKIP() << "There is no " << folder << ": set FRONTIER_SURFELS_DATA to the folder of recorded sequences.";
  expect_recorded(folder, {199, 1305031128.655554, {1.3452, 0.6273, 1.6627}, 1057, 854, true});
}

}  // namespace
