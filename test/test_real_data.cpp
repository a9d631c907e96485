/// Maps of recorded sequences, measured by the exact test. Skipped without recordings.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

fs::path data_folder() {
  const char* wanted = std::getenv("FRONTIER_SURFELS_DATA");
  return wanted != nullptr ? wanted : FRONTIER_SURFELS_DATA_DIR;
}

std::vector<fs::path> sequences() {
  std::vector<fs::path> folders;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(data_folder(), none))
    if (fs::exists(entry.path() / "camera.txt")) folders.push_back(entry.path());
  std::sort(folders.begin(), folders.end());
  return folders;
}

std::string why_skipped() {
  return "There is no recorded sequence in " + data_folder().string() + ": set FRONTIER_SURFELS_DATA to a folder with sequences.";
}

/// `count` frames from the start, of about 200 that are spread over the whole sequence. Between consecutive frames of a camera at 30 Hz
/// that hovers, the camera moves less than `recent_view_distance`: such frames are not kept as views, and what they add is forgotten.
Frames spread_frames(const fs::path& folder, int count) {
  replay::SourceOptions options;
  options.stride = std::max<int>(1, static_cast<int>(replay::open_source(folder.string(), options)->size()) / 200);
  options.last = (count - 1) * options.stride;
  const auto source = replay::open_source(folder.string(), options);
  Frames frames;
  while (auto frame = source->next()) frames.push_back(*frame);
  return frames;
}

/// The default configuration, with a working image of some 160 columns whatever the size of the sequence's images.
Config config_for(const Frames& frames) {
  Config config;
  config.decimation = std::max(1, frames.front().depth.cols / 160);
  return config;
}

TEST(RealData, MeasuresUpToTheExactTest) {
  if (sequences().empty()) GTEST_SKIP() << why_skipped();
  for (const fs::path& folder : sequences()) {
    const Frames frames = spread_frames(folder, 40);
    ASSERT_GE(frames.size(), 30u) << folder;
    const Config config = config_for(frames);
    const auto surfels = map_of(frames, config);
    const auto s = score(surfels, frames, config);
    SCOPED_TRACE(folder.filename().string() + ": " + text(s, surfels.size()));
    EXPECT_TRUE(all_sound(surfels));
    EXPECT_GE(s.right, 0.95);
    EXPECT_GE(s.within_2v, 0.99);
    EXPECT_LE(s.fdr_5cm, 0.003);
    EXPECT_LE(s.miss_2cm, 0.001);
    EXPECT_GE(s.label_ok, 0.96);
  }
}

TEST(RealData, TheSameForAnyNumberOfThreads) {
  if (sequences().empty()) GTEST_SKIP() << why_skipped();
  for (const fs::path& folder : sequences()) {
    const Frames frames = spread_frames(folder, 10);
    ASSERT_FALSE(frames.empty()) << folder;
    Config one_thread = config_for(frames), two_threads = config_for(frames);
    one_thread.threads = 1;
    two_threads.threads = 2;
    try {
      const auto surfels = map_of(frames, one_thread);
      EXPECT_GT(surfels.size(), 50000u) << folder;
      EXPECT_TRUE(same(surfels, map_of(frames, two_threads))) << folder;
    } catch (const DeviceError& error) {
      GTEST_SKIP() << "The device cannot be divided: " << error.what();
    }
  }
}

}  // namespace
}  // namespace frontier_surfels
