/// Frames that sequence_to_bag has written are read back as they were.
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <fstream>

#include "file_size_limit.hpp"
#include "recordings/bag_writer.hpp"
#include "ros/bag_input.hpp"
#include "synthetic/synthetic_room.hpp"

namespace frontier_surfels::replay {
namespace {

/// Frames of the synthetic room, kept in memory.
class RoomSource : public FrameSource {
 public:
  explicit RoomSource(std::vector<RecordedFrame> frames) : frames_(std::move(frames)) {}
  std::size_t size() const override { return frames_.size(); }
  std::optional<RecordedFrame> next() override { return done_ < frames_.size() ? std::optional(frames_[done_++]) : std::nullopt; }
  const std::vector<std::string>& skipped() const override { return none_; }
  const std::vector<std::string>& notes() const override { return none_; }

 private:
  std::vector<RecordedFrame> frames_;
  std::size_t done_ = 0;
  std::vector<std::string> none_;
};

class RoundTrip : public BagTest {
 protected:
  static constexpr int kFrames = 5;

  static std::vector<RecordedFrame> room_frames() {
    const Room room;
    SensorModel sensor;
    sensor.noise = true;
    sensor.dropouts = 0.05;
    std::vector<RecordedFrame> frames;
    for (int i = 0; i < kFrames; ++i) frames.push_back(room.render(i, 60, synthetic_camera(80, 60), sensor));
    return frames;
  }

  std::vector<RecordedFrame> write_and_read(const BagOptions& options) {
    RoomSource source(room_frames());
    EXPECT_EQ(write_bag(source, path_, options).frames, static_cast<std::size_t>(kFrames));
    EXPECT_FALSE(fs::exists(path_ + ".active"));
    const auto read = open_source(path_);
    EXPECT_EQ(read->size(), static_cast<std::size_t>(kFrames));
    std::vector<RecordedFrame> frames = read_all(*read);
    EXPECT_TRUE(read->skipped().empty());
    EXPECT_EQ(frames.size(), static_cast<std::size_t>(kFrames));
    return frames;
  }

  static void expect_same_but_images(const RecordedFrame& read, const RecordedFrame& written) {
    EXPECT_NEAR(read.stamp, written.stamp, 1e-9);
    EXPECT_LT((read.T_world_camera.matrix() - written.T_world_camera.matrix()).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_EQ(read.intrinsics.fx, written.intrinsics.fx);
    EXPECT_EQ(read.intrinsics.fy, written.intrinsics.fy);
    EXPECT_EQ(read.intrinsics.cx, written.intrinsics.cx);
    EXPECT_EQ(read.intrinsics.cy, written.intrinsics.cy);
    EXPECT_EQ(read.intrinsics.width, written.intrinsics.width);
    EXPECT_EQ(read.intrinsics.height, written.intrinsics.height);
  }
};

TEST_F(RoundTrip, AFullDiskIsASentenceAndLeavesNoBag) {
  std::ofstream(path_) << "an earlier bag";
  std::signal(SIGXFSZ, SIG_IGN);
  for (const rlim_t size : {0, 1000, 5000, 20000, 60000}) {
    RoomSource source(room_frames());
    std::string said;
    limit_file_size(true, size);
    try {
      write_bag(source, path_);
    } catch (const FileError& error) {
      said = error.what();
    }
    limit_file_size(false);
    EXPECT_NE(said.find("has space"), std::string::npos) << "at " << size << " bytes: " << said;
    EXPECT_FALSE(fs::exists(path_ + ".active"));
    EXPECT_EQ(fs::file_size(path_), 14u) << "the earlier bag is gone";
  }
}

TEST_F(RoundTrip, SixteenBitsComeBackAsTheyWere) {
  const std::vector<RecordedFrame> written = room_frames();
  BagOptions options;
  options.encoding = "16UC1";
  for (const char* compression : {"none", "lz4", "bz2"}) {
    options.compression = compression;
    const std::vector<RecordedFrame> read = write_and_read(options);
    ASSERT_EQ(read.size(), written.size());
    for (std::size_t i = 0; i < read.size(); ++i) {
      expect_same_but_images(read[i], written[i]);
      EXPECT_TRUE(same_bytes(read[i].depth, written[i].depth));
      EXPECT_TRUE(same_bytes(read[i].color, written[i].color));
    }
  }
}

/// The mapper computes float(0.001 mm), which is the nearest float to mm / 1000. Maps are the same bit for bit only if the bag contains
/// exactly these floats.
TEST_F(RoundTrip, MetresAreThoseOfTheMillimetres) {
  const std::vector<RecordedFrame> written = room_frames(), read = write_and_read({});
  ASSERT_EQ(read.size(), written.size());
  std::size_t measured = 0;
  for (std::size_t i = 0; i < read.size(); ++i) {
    expect_same_but_images(read[i], written[i]);
    ASSERT_EQ(read[i].depth.type(), CV_32FC1);
    for (int row = 0; row < 60; ++row) {
      for (int column = 0; column < 80; ++column) {
        const std::uint16_t millimetres = written[i].depth.at<std::uint16_t>(row, column);
        const float metres = read[i].depth.at<float>(row, column);
        if (millimetres == 0) {
          EXPECT_TRUE(std::isnan(metres));
        } else {
          EXPECT_EQ(metres, static_cast<float>(millimetres) / 1000.0F);
          ++measured;
        }
      }
    }
  }
  EXPECT_GT(measured, 10000u);
}

/// Numbers that are no measurement are none in the bag, and the others are depths in the recording's unit.
TEST_F(RoundTrip, SixteenBitsInAnotherUnit) {
  std::vector<RecordedFrame> written = room_frames();
  for (RecordedFrame& frame : written) {
    frame.depth = frame.depth * 4;
    frame.depth.at<std::uint16_t>(0, 0) = 65535;
    frame.depth.at<std::uint16_t>(0, 1) = 7001;
  }
  BagOptions options;
  options.depth_unit = 0.00025;
  for (const char* encoding : {"16UC1", "32FC1"}) {
    options.encoding = encoding;
    RoomSource source(written);
    write_bag(source, path_, options);
    const std::vector<RecordedFrame> read = read_all(*open_source(path_));
    ASSERT_EQ(read.size(), written.size());
    const cv::Mat& depth = read.back().depth;
    const bool metres = depth.type() == CV_32FC1;
    EXPECT_EQ(metres, std::string(encoding) == "32FC1");
    if (metres) {
      EXPECT_TRUE(std::isnan(depth.at<float>(0, 0)));
      EXPECT_EQ(depth.at<float>(0, 1), 1.75025F);
    } else {
      EXPECT_EQ(depth.at<std::uint16_t>(0, 0), 0);
      EXPECT_EQ(depth.at<std::uint16_t>(0, 1), 1750);
    }
  }
  options.depth_unit = 0;
  RoomSource source(written);
  EXPECT_THROW(write_bag(source, path_, options), Error);
}

TEST_F(RoundTrip, CompressedSixteenBits) {
  const std::vector<RecordedFrame> written = room_frames();
  BagOptions options;
  options.encoding = "16UC1";
  options.compressed = true;
  options.leading_slashes = false;
  options.static_transforms = true;
  const std::vector<RecordedFrame> read = write_and_read(options);
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    expect_same_but_images(read[i], written[i]);
    EXPECT_TRUE(same_bytes(read[i].depth, written[i].depth));
    ASSERT_EQ(read[i].color.size(), written[i].color.size());
    EXPECT_LT(cv::norm(read[i].color, written[i].color, cv::NORM_L1) / static_cast<double>(3 * written[i].color.total()), 6) << "JPEG";
  }
}

TEST_F(RoundTrip, CompressedMetresAreQuantisedInInverseDepth) {
  const std::vector<RecordedFrame> written = room_frames();
  BagOptions options;
  options.compressed = true;
  const std::vector<RecordedFrame> read = write_and_read(options);
  ASSERT_EQ(read.size(), written.size());
  for (int i = 0; i < 80 * 60; ++i) {
    const std::uint16_t millimetres = written[2].depth.at<std::uint16_t>(i / 80, i % 80);
    const float metres = read[2].depth.at<float>(i / 80, i % 80);
    if (millimetres == 0) {
      EXPECT_TRUE(std::isnan(metres));
    } else {
      const float z = static_cast<float>(millimetres) / 1000.0F;
      EXPECT_NEAR(metres, z, 0.51 * z * z / (100 * 101));
    }
  }
}

TEST_F(RoundTrip, StampsBelowOneSecondAreShifted) {
  std::vector<RecordedFrame> frames = room_frames();
  for (int i = 0; i < kFrames; ++i) frames[static_cast<std::size_t>(i)].stamp = i * 0.2;
  RoomSource source(frames);
  EXPECT_EQ(write_bag(source, path_).stamp_shift, 1.0);
  const std::vector<RecordedFrame> read = read_all(*open_source(path_));
  ASSERT_EQ(read.size(), frames.size());
  EXPECT_NEAR(read[0].stamp, 1.0, 1e-9);
  EXPECT_NEAR(read[4].stamp, 1.8, 1e-9);
  EXPECT_LT((read[0].T_world_camera.matrix() - frames[0].T_world_camera.matrix()).norm(), 1e-14);
}

TEST_F(RoundTrip, HonoursFirstLastAndStride) {
  const std::vector<RecordedFrame> written = room_frames();
  RoomSource source(written);
  write_bag(source, path_);
  SourceOptions options;
  options.first = 1;
  options.last = 4;
  options.stride = 3;
  const auto read = open_source(path_, options);
  EXPECT_EQ(read->size(), 2u);
  const std::vector<RecordedFrame> frames = read_all(*read);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_NEAR(frames[0].stamp, written[1].stamp, 1e-9);
  EXPECT_NEAR(frames[1].stamp, written[4].stamp, 1e-9);
  EXPECT_TRUE(same_bytes(frames[1].color, written[4].color));
}

TEST_F(RoundTrip, WritesNothingFromNothing) {
  RoomSource source({});
  EXPECT_THROW(write_bag(source, path_), Error);
  EXPECT_FALSE(fs::exists(path_));
  EXPECT_FALSE(fs::exists(path_ + ".active"));
  RoomSource other(room_frames());
  EXPECT_THROW(write_bag(other, (folder_ / "nowhere" / "x.bag").string()), Error);
}

}  // namespace
}  // namespace frontier_surfels::replay
