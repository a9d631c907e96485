/// Maps of recorded sequences, measured by the exact test. Skipped without recordings.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "mapper_input.hpp"
#include "stages/test_device.hpp"

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

/// A configuration with a working image of some 160 columns, whatever the size of the sequence's images.
Config config_for(const Frames& frames, Config config = {}) {
  config.decimation = std::max(1, frames.front().depth.cols / 160);
  return config;
}

/// Errors that a configuration has reached on the sequence of that name. Other sequences may have those of the worst of all.
using Reached = std::map<std::string, Errors>;

Errors reached_on(const std::string& sequence, const Reached& reached) {
  if (reached.count(sequence) > 0) return reached.at(sequence);
  Errors worst;
  for (const auto& [name, errors] : reached)
    for (double Errors::*share :
         {&Errors::not_right, &Errors::beyond_2v, &Errors::fdr_5cm, &Errors::miss_2cm, &Errors::miss_5cm, &Errors::wrong_label})
      worst.*share = std::max(worst.*share, errors.*share);
  return worst;
}

/// @param at_least  see expect_errors; only for sequences of known names
void expect_reached(const Config& base, const Reached& reached, double at_least) {
  for (const fs::path& folder : sequences()) {
    const Frames frames = spread_frames(folder, 40);
    ASSERT_GE(frames.size(), 30u) << folder;
    const Config config = config_for(frames, base);
    Mapper mapper(config);
    const Frames seen = mapped(mapper, frames);
    const auto surfels = mapper.surfels();
    const auto s = score(surfels, seen, config);
    const std::string name = folder.filename().string();
    SCOPED_TRACE(name + ": " + text(s, surfels.size()));
    EXPECT_TRUE(all_sound(surfels));
    expect_errors(s, reached_on(name, reached), reached.count(name) > 0 ? at_least : 0);
  }
}

TEST(RealData, MeasuresUpToTheExactTest) {
  if (sequences().empty()) GTEST_SKIP() << why_skipped();
  const Reached reached = {{"7scenes_redkitchen", {0.00102, 0.00047, 0.00003, 0.00016, 0.00000, 0.01222}},
                           {"7scenes_redkitchen_long", {0.00108, 0.00051, 0.00003, 0.00022, 0.00003, 0.01394}},
                           {"tum_fr1_xyz", {0.00085, 0.00013, 0.00002, 0.00041, 0.00008, 0.00900}}};
  expect_reached({}, reached, 0);
}

TEST(RealData, ThePapersConfigurationMeasuresUpToTheExactTest) {
  if (sequences().empty()) GTEST_SKIP() << why_skipped();
  const Reached reached = {{"7scenes_redkitchen", {0.06727, 0.01163, 0.00637, 0.21592, 0.11384, 0.06630}},
                           {"7scenes_redkitchen_long", {0.06727, 0.01163, 0.00637, 0.21592, 0.11384, 0.06630}},
                           {"tum_fr1_xyz", {0.06983, 0.00944, 0.00571, 0.10442, 0.03308, 0.02967}}};
  expect_reached(load_config(FRONTIER_SURFELS_SOURCE_DIR "/config/paper.yaml"), reached, 0.5);
}

TEST(RealData, TheSameForAnyNumberOfThreads) {
  if (sequences().empty()) GTEST_SKIP() << why_skipped();
  if (!can_be_divided(choose_device({}))) GTEST_SKIP() << "The device cannot be divided.";
  for (const fs::path& folder : sequences()) {
    const Frames frames = spread_frames(folder, 10);
    ASSERT_FALSE(frames.empty()) << folder;
    Config one_thread = config_for(frames), two_threads = config_for(frames);
    one_thread.threads = 1;
    two_threads.threads = 2;
    const auto surfels = map_of(frames, one_thread);
    EXPECT_GT(surfels.size(), 50000u) << folder;
    EXPECT_TRUE(same(surfels, map_of(frames, two_threads))) << folder;
  }
}

}  // namespace
}  // namespace frontier_surfels
