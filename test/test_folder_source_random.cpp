/// Recordings in folders with bytes damaged at random: never a crash, always frames or a sentence.
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "random_bytes.hpp"
#include "recordings/frame_source.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels::replay {
namespace {

namespace fs = std::filesystem;

/// A recording that can be read in both layouts: depth/, color/, poses.txt, camera.txt, or with TUM's depth.txt, rgb.txt, groundtruth.txt.
class DamagedFolder : public testing::Test {
 protected:
  void SetUp() override {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    fs::create_directories(folder_ / "depth");
    fs::create_directories(folder_ / "color");
    cv::Mat depth(24, 32, CV_16UC1), color(24, 32, CV_8UC3);
    cv::randu(depth, 500, 4000);
    cv::randu(color, 0, 255);
    std::string poses, depths, colors;
    for (int i = 0; i < 3; ++i) {
      const std::string name = std::to_string(i), stamp = std::to_string(10 + 0.1 * i);
      cv::imwrite((folder_ / "depth" / (name + ".png")).string(), depth);
      cv::imwrite((folder_ / "color" / (name + ".jpg")).string(), color);
      poses += stamp + " 1.25 -2.5 " + name + " 0 0 0.6 0.8\n";
      depths += stamp + " depth/" + name + ".png\n";
      colors += stamp + " color/" + name + ".jpg\n";
    }
    write_bytes(path("poses.txt"), "# stamp tx ty tz qx qy qz qw\n" + poses);
    write_bytes(path("groundtruth.txt"), poses);
    write_bytes(path("depth.txt"), depths);
    write_bytes(path("rgb.txt"), colors);
    write_bytes(path("camera.txt"), "525.5 525.25 15.5 11.5 32 24\n");
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  void read() const {
    const auto source = open_source(folder_.string());
    while (const auto frame = source->next()) frame->view();
    for (const std::string& sentence : source->skipped()) EXPECT_GT(sentence.size(), 20u);
    if (source->skipped().size() == source->size()) throw BadFrame(source->skipped().front());
  }

  /// Damages one file after the other and reads the whole recording.
  void read_damaged(const std::vector<std::string>& names, int usual) const {
    std::vector<std::string> intact;
    for (const std::string& name : names) intact.push_back(read_bytes(path(name)));
    read();
    const int inputs = random_inputs(usual) / static_cast<int>(names.size());
    for (std::size_t n = 0; n < names.size(); ++n) {
      SCOPED_TRACE(names[n]);
      expect_sentences(inputs, [&](Damage& damage) {
        write_bytes(path(names[n]), damage(intact[n]));
        read();
      });
      write_bytes(path(names[n]), intact[n]);
    }
  }

  const TemporaryFolder temporary_{"damaged_folder"};
  const fs::path folder_ = temporary_.path();
};

TEST_F(DamagedFolder, PosesAndCamera) { read_damaged({"poses.txt", "camera.txt"}, 2000); }

TEST_F(DamagedFolder, ListsOfTum) {
  fs::remove(folder_ / "poses.txt");
  read_damaged({"depth.txt", "groundtruth.txt"}, 2000);
}

/// One frame is damaged in each recording, so that a recording is refused only if its only frame is.
TEST_F(DamagedFolder, DepthImages) {
  write_bytes(path("poses.txt"), "10 1 2 3 0 0 0 1\n");
  for (const char* name : {"depth/1.png", "depth/2.png"}) fs::remove(folder_ / name);
  read_damaged({"depth/0.png"}, 2000);
}

}  // namespace
}  // namespace frontier_surfels::replay
