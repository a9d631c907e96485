/// Reading of folders: both layouts, every fault, and the recorded sequences if they are there.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "recordings/frame_source.hpp"
#include "temporary_folder.hpp"

namespace fs = std::filesystem;
using frontier_surfels::DepthFrame;
using frontier_surfels::Error;
using frontier_surfels::TemporaryFolder;
using frontier_surfels::replay::FrameSource;
using frontier_surfels::replay::open_source;
using frontier_surfels::replay::RecordedFrame;
using frontier_surfels::replay::SourceOptions;

namespace {

/// The message with which opening `path` fails; empty if it does not fail.
std::string failure(const fs::path& path, const SourceOptions& options = {}) {
  try {
    open_source(path.string(), options);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

std::vector<RecordedFrame> read_all(FrameSource& source) {
  std::vector<RecordedFrame> frames;
  while (std::optional<RecordedFrame> frame = source.next()) frames.push_back(std::move(*frame));
  return frames;
}

testing::AssertionResult says(const std::string& sentence, const std::string& part) {
  if (sentence.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << part << "' is not in '" << sentence << "'";
}

SourceOptions part(int first, int last = -1, int stride = 1) {
  SourceOptions options;
  options.first = first;
  options.last = last;
  options.stride = stride;
  return options;
}

/// A folder that is removed after the test.
class FolderTest : public testing::Test {
 protected:
  void write_text(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  /// An image of 4 x 3 pixels with the values `value`, `value` + 1, ...
  void write_depth(const std::string& name, int value, int type = CV_16UC1) const {
    cv::Mat image(3, 4, CV_16UC1);
    for (int i = 0; i < 12; ++i) image.at<std::uint16_t>(i / 4, i % 4) = static_cast<std::uint16_t>(value + i);
    image.convertTo(image, type);
    fs::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(cv::imwrite((folder_ / name).string(), image));
  }

  void write_color(const std::string& name, const cv::Size& size = {4, 3}) const {
    fs::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(cv::imwrite((folder_ / name).string(), cv::Mat(size, CV_8UC3, cv::Scalar(200, 100, 50))));
  }

  /// Writes depth/000000.png, ... with 1000, 2000, ... mm, and poses at x = 0, 1, ...
  void write_sequence(int frames) const {
    std::string poses = "# stamp tx ty tz qx qy qz qw\n\n";
    for (int i = 0; i < frames; ++i) {
      write_depth("depth/00000" + std::to_string(i) + ".png", 1000 * (i + 1));
      poses += std::to_string(0.5 * i) + " " + std::to_string(i) + " 2 3 0 0 0 1\n";
    }
    write_text("poses.txt", poses);
    write_text("camera.txt", "# fx fy cx cy width height\n5 6 1.5 1.25 4 3\n");
  }

  std::unique_ptr<FrameSource> open(const SourceOptions& options = {}) const { return open_source(folder_.string(), options); }

  const TemporaryFolder temporary_{"folder_source"};
  const fs::path folder_ = temporary_.path();
};

TEST_F(FolderTest, ReadsImagesPosesAndCamera) {
  write_sequence(3);
  write_color("color/000001.png");
  const auto source = open();
  EXPECT_EQ(source->size(), 3u);
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_TRUE(source->skipped().empty());
  EXPECT_DOUBLE_EQ(frames[1].stamp, 0.5);
  EXPECT_EQ(frames[1].depth.type(), CV_16UC1);
  EXPECT_EQ(frames[1].depth.at<std::uint16_t>(2, 3), 2011);
  EXPECT_EQ(frames[1].T_world_camera.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(frames[1].intrinsics.fx, 5);
  EXPECT_EQ(frames[1].intrinsics.fy, 6);
  EXPECT_EQ(frames[1].intrinsics.cx, 1.5);
  EXPECT_EQ(frames[1].intrinsics.cy, 1.25);
  EXPECT_EQ(frames[1].intrinsics.width, 4);
  EXPECT_EQ(frames[1].intrinsics.height, 3);
  EXPECT_TRUE(frames[0].color.empty());
  ASSERT_FALSE(frames[1].color.empty());
  EXPECT_EQ(frames[1].color.at<cv::Vec3b>(0, 0), cv::Vec3b(200, 100, 50));
}

TEST_F(FolderTest, ViewsTheImagesInPlace) {
  write_sequence(1);
  write_color("color/000000.png");
  const auto source = open();
  const std::optional<RecordedFrame> frame = source->next();
  ASSERT_TRUE(frame);
  const DepthFrame view = frame->view();
  EXPECT_EQ(view.depth.data, frame->depth.data);
  EXPECT_EQ(view.depth.step, 8u);
  EXPECT_EQ(view.depth.encoding, frontier_surfels::DepthImage::Encoding::kStepsU16);
  EXPECT_EQ(view.depth.width, 4);
  EXPECT_EQ(view.depth.height, 3);
  ASSERT_TRUE(view.color);
  EXPECT_EQ(view.color->data, frame->color.data);
  EXPECT_EQ(view.color->step, 12u);
  EXPECT_EQ(view.color->order, frontier_surfels::ColorImage::Order::kBgr);

  RecordedFrame wrong = *frame;
  wrong.depth = cv::Mat(3, 4, CV_8UC1);
  EXPECT_THROW(wrong.view(), frontier_surfels::BadFrame);
  EXPECT_TRUE(RecordedFrame().T_world_camera.matrix().hasNaN()) << "a pose that was never set must not be valid";
}

TEST_F(FolderTest, NumbersWithoutZerosKeepTheirOrder) {
  std::string poses;
  for (int i = 8; i <= 11; ++i) {
    write_depth("depth/" + std::to_string(i) + ".png", 100 * i);
    poses += std::to_string(i) + " 0 0 0 0 0 0 1\n";
  }
  write_text("poses.txt", poses);
  write_text("camera.txt", "5 6 1 1 4 3\n");
  const auto source = open();
  for (int i = 8; i <= 11; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->stamp, i);
    EXPECT_EQ(frame->depth.at<std::uint16_t>(0, 0), 100 * i);
  }
}

TEST_F(FolderTest, NormalisesQuaternionsAndRefusesOthers) {
  write_sequence(5);
  write_text("poses.txt",
             "0 0 0 0 0 0 0.703 0.703\n"  // 0.994: normalised
             "1 0 0 0 0 0 0 0\n"          // none
             "2 nan 0 0 0 0 0 1\n"        // tracking lost
             "3 0 0 0 0 0 0.8 0.8\n"      // 1.13
             "4 0 0 inf 0 0 0 1\n");
  const auto source = open();
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_NEAR((frames[0].T_world_camera.linear() - Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()).matrix()).norm(), 0, 1e-15);
  ASSERT_EQ(source->skipped().size(), 4u);
  EXPECT_TRUE(says(source->skipped()[0], "quaternion"));
  EXPECT_TRUE(says(source->skipped()[1], "not finite"));
  EXPECT_TRUE(says(source->skipped()[1], "000002.png"));
  EXPECT_TRUE(says(source->skipped()[2], "1.13"));
  EXPECT_TRUE(says(source->skipped()[3], "not finite"));
}

TEST_F(FolderTest, PassesOverImagesThatCannotBeUsed) {
  write_sequence(5);
  write_text("depth/000000.png", "");
  fs::resize_file(folder_ / "depth/000001.png", fs::file_size(folder_ / "depth/000001.png") / 2);
  write_depth("depth/000002.png", 0, CV_8UC1);
  cv::imwrite((folder_ / "depth/000003.png").string(), cv::Mat(3, 5, CV_16UC1, cv::Scalar(1000)));
  const auto source = open();
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].stamp, 2.0);
  EXPECT_EQ(source->size(), 5u);
  ASSERT_EQ(source->skipped().size(), 4u);
  EXPECT_TRUE(says(source->skipped()[0], "cannot be read"));
  EXPECT_TRUE(says(source->skipped()[1], "cannot be read"));
  EXPECT_TRUE(says(source->skipped()[2], "16 bits"));
  EXPECT_TRUE(says(source->skipped()[3], "5x3"));
}

TEST_F(FolderTest, ColourThatCannotBeUsedCostsNoFrame) {
  write_sequence(2);
  write_color("color/000000.png", {8, 6});
  write_text("color/000001.jpg", "no image");
  const auto source = open();
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_TRUE(frames[0].color.empty());
  EXPECT_TRUE(frames[1].color.empty());
  ASSERT_EQ(source->notes().size(), 2u);
  EXPECT_TRUE(says(source->notes()[0], "another size"));
  EXPECT_TRUE(says(source->notes()[1], "cannot be read"));
}

TEST_F(FolderTest, HonoursFirstLastAndStride) {
  write_sequence(7);
  const auto source = open(part(1, 5, 2));
  EXPECT_EQ(source->size(), 3u);
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0].depth.at<std::uint16_t>(0, 0), 2000);
  EXPECT_EQ(frames[2].depth.at<std::uint16_t>(0, 0), 6000);

  EXPECT_EQ(open(part(1, 100, 2))->size(), 3u) << "a last frame beyond the end means the end";
  EXPECT_TRUE(says(failure(folder_, part(7)), "7 frames"));
  EXPECT_TRUE(says(failure(folder_, part(-1)), "first"));
  EXPECT_TRUE(says(failure(folder_, part(3, 2)), "last"));
  EXPECT_TRUE(says(failure(folder_, part(0, -1, 0)), "stride"));
}

TEST_F(FolderTest, SaysWhatIsMissing) {
  EXPECT_TRUE(says(failure(folder_ / "nowhere"), "nowhere"));
  EXPECT_TRUE(says(failure(folder_), "poses.txt"));
  write_text("poses.txt", "");
  EXPECT_TRUE(says(failure(folder_), "depth/"));
  fs::create_directory(folder_ / "depth");
  EXPECT_TRUE(says(failure(folder_), "camera.txt"));
  write_text("camera.txt", "5 6 1 1 4 3\n");
  EXPECT_TRUE(says(failure(folder_), "no frames"));
  write_sequence(3);
  write_text("poses.txt", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
  EXPECT_TRUE(says(failure(folder_), "2 poses"));
  EXPECT_TRUE(says(failure(folder_), "3 images"));
}

TEST_F(FolderTest, NamesTheLineThatIsMalformed) {
  write_sequence(1);
  write_text("poses.txt", "# comment\n0 0 0 0 0 0 1\n");
  EXPECT_TRUE(says(failure(folder_), "line 2"));
  write_text("poses.txt", "0 0 0 0 0 0 0 1x\n");
  EXPECT_TRUE(says(failure(folder_), "'1x'"));
  write_sequence(1);
  for (const char* camera : {"", "5 6 1 1 4\n", "0 6 1 1 4 3\n", "5 nan 1 1 4 3\n", "5 6 1 1 4.5 3\n", "5 6 1 1 4 0\n", "a b c d e f\n"}) {
    write_text("camera.txt", camera);
    EXPECT_TRUE(says(failure(folder_), "camera.txt")) << "for: " << camera;
  }
}

TEST_F(FolderTest, ByteOrderMarksAreNoText) {
  write_sequence(1);
  write_text("camera.txt",
             "\xEF\xBB\xBF"
             "5 6 1.5 1.25 4 3\n");
  write_text("poses.txt",
             "\xEF\xBB\xBF"
             "0.5 1 2 3 0 0 0 1\n");
  const std::vector<RecordedFrame> frames = read_all(*open());
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].stamp, 0.5);
  EXPECT_EQ(frames[0].intrinsics.fx, 5);
}

/// The layout of TUM RGB-D, where the stamps of depth, colour and poses differ.
class TumFolderTest : public FolderTest {
 protected:
  void write_tum() const {
    write_depth("depth/a.png", 5000);
    write_depth("depth/b.png", 0);
    write_depth("depth/c.png", 10000);
    write_color("rgb/a.png");
    write_text("depth.txt", "# depth maps\n10.000 depth/a.png\n10.100 depth/b.png\n10.200 depth/c.png\n");
    write_text("rgb.txt", "9.985 rgb/a.png\n10.179 rgb/a.png\n");
    write_text(
        "groundtruth.txt",
        "# ground truth\n9.989 1 0 0 0 0 0 1\n10.008 2 0 0 0 0 0 1\n10.013 3 0 0 0 0 0 1\n10.079 4 0 0 0 0 0 1\n10.219 5 0 0 0 0 0 1\n");
    write_text("camera.txt", "5 6 1 1 4 3\n");
  }
};

TEST_F(TumFolderTest, TakesTheNearestWithinTwentyMilliseconds) {
  write_tum();
  const auto source = open();
  EXPECT_EQ(source->size(), 3u);
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].stamp, 10.0);
  EXPECT_EQ(frames[0].T_world_camera.translation().x(), 2);
  EXPECT_EQ(frames[1].T_world_camera.translation().x(), 5);
  EXPECT_FALSE(frames[0].color.empty());
  EXPECT_TRUE(frames[1].color.empty()) << "21 ms are too far";
  ASSERT_EQ(source->skipped().size(), 1u);
  EXPECT_TRUE(says(source->skipped()[0], "b.png"));
  EXPECT_TRUE(says(source->skipped()[0], "20 ms"));
}

TEST_F(TumFolderTest, SortsImagesByTheirStamps) {
  write_tum();
  EXPECT_TRUE(open()->notes().empty());
  write_text("depth.txt",
             "\xEF\xBB\xBF"
             "10.200 depth/c.png\n10.000 depth/a.png\n10.100 depth/b.png\n");
  write_text("rgb.txt",
             "\xEF\xBB\xBF"
             "9.985 rgb/a.png\n10.179 rgb/a.png\n");
  const auto source = open();
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].stamp, 10.0);
  EXPECT_EQ(frames[1].stamp, 10.2);
  ASSERT_EQ(source->notes().size(), 1u);
  EXPECT_TRUE(says(source->notes()[0], "depth.txt"));
  EXPECT_TRUE(says(source->notes()[0], "sorted"));
}

TEST_F(TumFolderTest, ConvertsToMetres) {
  write_tum();
  const std::vector<RecordedFrame> frames = read_all(*open());
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].depth.type(), CV_32FC1);
  EXPECT_EQ(frames[0].depth.at<float>(0, 0), 1.0f);
  EXPECT_EQ(frames[0].depth.at<float>(2, 3), 5011.0f / 5000.0f);
  EXPECT_EQ(frames[1].depth.at<float>(0, 0), 2.0f);
  EXPECT_EQ(frames[0].view().depth.encoding, frontier_surfels::DepthImage::Encoding::kMetresF32);
}

TEST_F(TumFolderTest, TheLargestNumberIsNoMeasurement) {
  write_tum();
  write_depth("depth/a.png", 65530);  // the sixth pixel has 65535
  const std::vector<RecordedFrame> frames = read_all(*open());
  EXPECT_EQ(frames.at(0).depth.at<float>(1, 0), 65534 / 5000.0f);
  EXPECT_EQ(frames.at(0).depth.at<float>(1, 1), 0);
}

TEST_F(TumFolderTest, FrameWhoseImageIsMissingIsPassedOver) {
  write_tum();
  fs::remove(folder_ / "depth/a.png");
  const auto source = open();
  EXPECT_EQ(read_all(*source).size(), 1u);
  ASSERT_EQ(source->skipped().size(), 2u);
  EXPECT_TRUE(says(source->skipped()[0], "no such file"));
}

TEST_F(TumFolderTest, KnowsTheBenchmarksCamerasByName) {
  write_tum();
  fs::remove(folder_ / "camera.txt");
  EXPECT_TRUE(says(failure(folder_), "camera.txt"));
  const struct {
    const char* name;
    double fx;
  } kCameras[] = {{"rgbd_dataset_freiburg1_desk", 517.3}, {"rgbd_dataset_freiburg2_xyz", 520.9}, {"x_fr3_office", 535.4}};
  for (const auto& camera : kCameras) {
    const fs::path named = folder_ / camera.name;
    fs::create_directories(named / "depth");
    cv::imwrite((named / "depth/a.png").string(), cv::Mat(480, 640, CV_16UC1, cv::Scalar(5000)));
    for (const char* file : {"depth.txt", "groundtruth.txt"}) fs::copy(folder_ / file, named / file);
    const auto source = open_source(named.string() + "/");
    ASSERT_EQ(source->notes().size(), 1u);
    EXPECT_TRUE(says(source->notes()[0], "calibration"));
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->intrinsics.fx, camera.fx);
  }
}

}  // namespace
