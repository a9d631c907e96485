/// Maps of recorded sequences, measured by the exact test. Skipped without recordings.
#include <gtest/gtest.h>

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

Frames first_frames(const fs::path& folder, int count) {
  replay::SourceOptions options;
  options.last = count - 1;
  const auto source = replay::open_source(folder.string(), options);
  Frames frames;
  while (auto frame = source->next()) frames.push_back(*frame);
  return frames;
}

TEST(RealData, MeasuresUpToTheExactTest) {
  if (sequences().empty()) GTEST_SKIP() << why_skipped();
  for (const fs::path& folder : sequences()) {
    const Frames frames = first_frames(folder, 40);
    ASSERT_GE(frames.size(), 30u) << folder;
    const auto surfels = map_of(frames, Config());
    const auto s = score(surfels, frames, Config());
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
    const Frames frames = first_frames(folder, 10);
    Config one_thread, two_threads;
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
