/// Bags: what sequence_to_bag writes comes back; every encoding, transforms of all kinds, and every fault.
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <stdlib.h>
#include <tf2_msgs/TFMessage.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "frontier_surfels/replay/frame_source.hpp"
#include "frontier_surfels/replay/synthetic_room.hpp"
#include "replay/bag_messages.hpp"
#include "replay/bag_writer.hpp"

namespace fs = std::filesystem;
using frontier_surfels::BadFrame;
using frontier_surfels::Error;
using frontier_surfels::Intrinsics;
using namespace frontier_surfels::replay;

namespace {

testing::AssertionResult says(const std::string& sentence, const std::string& part) {
  if (sentence.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << part << "' is not in '" << sentence << "'";
}

std::vector<RecordedFrame> read_all(FrameSource& source) {
  std::vector<RecordedFrame> frames;
  while (std::optional<RecordedFrame> frame = source.next()) frames.push_back(std::move(*frame));
  return frames;
}

/// Whether two images are the same, NaN included.
bool same_bytes(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && a.isContinuous() && b.isContinuous() &&
         std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

/// Frames of the room, held in memory.
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

/// A folder for bags that is gone after the test.
class BagTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "bag_source_XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    path_ = (folder_ / "test.bag").string();
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string failure(const SourceOptions& options = {}) const {
    try {
      open_source(path_, options);
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  }

  fs::path folder_;
  std::string path_;
};

// ---- What sequence_to_bag writes ----

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

/// The mapper takes float(mm) * 0.001f; maps are the same bit for bit only if the bag has those very floats.
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
          EXPECT_EQ(metres, static_cast<float>(millimetres) * 0.001f);
          ++measured;
        }
      }
    }
  }
  EXPECT_GT(measured, 10000u);
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
      const float z = static_cast<float>(millimetres) * 0.001f;
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

// ---- Bags made by hand ----

constexpr int kWidth = 4, kHeight = 3;

sensor_msgs::Image depth_message(double stamp, std::uint16_t value = 1500) {
  sensor_msgs::Image image;
  image.header.stamp = ros::Time(stamp);
  image.header.frame_id = "camera";
  image.width = kWidth;
  image.height = kHeight;
  image.encoding = "16UC1";
  image.step = 2 * kWidth;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    image.data.push_back(static_cast<std::uint8_t>(value & 255));
    image.data.push_back(static_cast<std::uint8_t>(value >> 8));
  }
  return image;
}

sensor_msgs::Image color_message(double stamp, const std::string& encoding, const std::vector<std::uint8_t>& pixel) {
  sensor_msgs::Image image = depth_message(stamp);
  image.encoding = encoding;
  image.step = static_cast<std::uint32_t>(kWidth * pixel.size());
  image.data.clear();
  for (int i = 0; i < kWidth * kHeight; ++i) image.data.insert(image.data.end(), pixel.begin(), pixel.end());
  return image;
}

sensor_msgs::CameraInfo info_message(double stamp, double focal_length = 5) {
  sensor_msgs::CameraInfo info;
  info.header.stamp = ros::Time(stamp);
  info.width = kWidth;
  info.height = kHeight;
  info.K = {focal_length, 0, 1.5, 0, focal_length + 1, 1.25, 0, 0, 1};
  return info;
}

tf2_msgs::TFMessage tf_message(double stamp, const std::string& parent, const std::string& child, double x) {
  tf2_msgs::TFMessage message;
  message.transforms.resize(1);
  message.transforms[0].header.stamp = ros::Time(stamp);
  message.transforms[0].header.frame_id = parent;
  message.transforms[0].child_frame_id = child;
  message.transforms[0].transform.translation.x = x;
  message.transforms[0].transform.rotation.w = 1;
  return message;
}

/// Writes messages at whatever time.
class Handmade {
 public:
  explicit Handmade(const std::string& path) { bag_.open(path, rosbag::bagmode::Write); }

  template <typename Message>
  Handmade& add(const std::string& topic, double time, const Message& message) {
    bag_.write(topic, ros::Time(time), message);
    return *this;
  }

  /// As tf's first version wrote it: the same message of another name.
  Handmade& add_of_old_type(const std::string& topic, double time, const tf2_msgs::TFMessage& message) {
    namespace traits = ros::message_traits;
    const ros::M_string header = {
        {"type", "tf/tfMessage"}, {"md5sum", traits::md5sum(message)}, {"message_definition", traits::definition(message)}};
    bag_.write(topic, ros::Time(time), message, boost::make_shared<ros::M_string>(header));
    return *this;
  }

  /// What every test needs and none is about: a camera that moves 1 m in 1 s from time 10 on.
  Handmade& add_camera_and_motion() {
    add("/depth/camera_info", 10, info_message(10));
    add("/tf", 10, tf_message(10, "world", "camera", 0));
    return add("/tf", 11, tf_message(11, "world", "camera", 1));
  }

 private:
  rosbag::Bag bag_;
};

TEST_F(BagTest, InterpolatesPosesAndPassesOverWhereThereAreNone) {
  Handmade(path_)
      .add_camera_and_motion()
      .add("/depth/image", 9, depth_message(9.5))
      .add("/depth/image", 10.25, depth_message(10.25))
      .add("/depth/image", 10.5, depth_message(0))
      .add("/depth/image", 11.5, depth_message(11.5));
  const auto source = open_source(path_);
  EXPECT_EQ(source->size(), 4u);
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_NEAR((frames[0].T_world_camera.translation() - Eigen::Vector3d(0.25, 0, 0)).norm(), 0, 1e-9);
  EXPECT_EQ(frames[0].depth.at<std::uint16_t>(2, 3), 1500);
  EXPECT_TRUE(frames[0].color.empty());
  ASSERT_EQ(source->skipped().size(), 3u);
  EXPECT_TRUE(says(source->skipped()[0], "Frame 0"));
  EXPECT_TRUE(says(source->skipped()[0], "pose is not known"));
  EXPECT_TRUE(says(source->skipped()[1], "stamp is 0"));
  EXPECT_TRUE(says(source->skipped()[2], "Frame 3"));
}

TEST_F(BagTest, StaticTransformsCountFromAnywhereInTheBag) {
  Handmade(path_)
      .add("/depth/camera_info", 10, info_message(10))
      .add("/depth/image", 10, depth_message(10))
      .add_of_old_type("tf", 10, tf_message(10, "/odom", "/base", 2))
      .add("/tf", 10.1, tf_message(10.1, "odom", "base", 2))
      .add("/tf_static", 99, tf_message(99, "/base", "camera", 3))
      .add("/tf_static", 99, tf_message(99, "map", "odom", 4));
  auto source = open_source(path_);
  auto frame = source->next();
  ASSERT_TRUE(frame) << source->skipped()[0];
  EXPECT_EQ(frame->T_world_camera.translation().x(), 9) << "from the root, map";
  SourceOptions options;
  options.world_frame = "/odom";
  source = open_source(path_, options);
  frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->T_world_camera.translation().x(), 5);
  options.world_frame = "nowhere";
  EXPECT_TRUE(says(failure(options), "nowhere"));
  EXPECT_TRUE(says(failure(options), "map -> odom"));
  options.world_frame = "/camera";
  EXPECT_TRUE(says(failure(options), "depth images themselves"));
}

TEST_F(BagTest, WithoutTransformsThereIsNoIdentity) {
  Handmade(path_).add("/depth/camera_info", 10, info_message(10)).add("/depth/image", 10, depth_message(10));
  EXPECT_TRUE(says(failure(), "'camera'"));
  Handmade(path_)
      .add("/depth/camera_info", 10, info_message(10))
      .add("/depth/image", 10, depth_message(10))
      .add("/tf", 10, tf_message(10, "camera", "something_on_it", 1));
  EXPECT_TRUE(says(failure(), "as its child"));
}

TEST_F(BagTest, DamagedTransformsAreLeftOut) {
  tf2_msgs::TFMessage no_rotation = tf_message(10.5, "world", "camera", 7);
  no_rotation.transforms[0].transform.rotation.w = 0;
  tf2_msgs::TFMessage not_finite = tf_message(10.5, "world", "camera", std::numeric_limits<double>::quiet_NaN());
  Handmade(path_)
      .add_camera_and_motion()
      .add("/tf", 10.5, no_rotation)
      .add("/tf", 10.5, not_finite)
      .add("/depth/image", 10.5, depth_message(10.5));
  const auto source = open_source(path_);
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_NEAR(frame->T_world_camera.translation().x(), 0.5, 1e-9);
  EXPECT_TRUE(says(source->notes().front(), "2 transforms"));
}

TEST_F(BagTest, CameraInfoMayChangeAndMustBeThere) {
  Handmade(path_)
      .add_camera_and_motion()
      .add("/depth/camera_info", 10.5, info_message(10.5, 50))
      .add("/depth/image", 10.0, depth_message(10.0))
      .add("/depth/image", 10.4, depth_message(10.4))
      .add("/depth/image", 10.5, depth_message(10.5))
      .add("/depth/image", 10.9, depth_message(10.9));
  const std::vector<RecordedFrame> frames = read_all(*open_source(path_));
  ASSERT_EQ(frames.size(), 4u);
  EXPECT_EQ(frames[0].intrinsics.fx, 5);
  EXPECT_EQ(frames[1].intrinsics.fx, 5);
  EXPECT_EQ(frames[2].intrinsics.fx, 50);
  EXPECT_EQ(frames[3].intrinsics.fy, 51);

  Handmade(path_)
      .add("/tf", 10, tf_message(10, "world", "camera", 0))
      .add("/depth/image", 10, depth_message(10))
      .add("/ir/camera_info", 10, info_message(10));
  EXPECT_TRUE(says(failure(), "/depth/camera_info"));
  EXPECT_TRUE(says(failure(), "/ir/camera_info"));
  SourceOptions options;
  options.info_topic = "ir/camera_info";
  EXPECT_EQ(open_source(path_, options)->next()->intrinsics.fx, 5);
}

TEST_F(BagTest, ImagesThatDoNotFitTheirCameraArePassedOver) {
  sensor_msgs::CameraInfo info = info_message(10.5);
  info.width = 640;
  sensor_msgs::Image truncated = depth_message(10.2);
  truncated.data.pop_back();
  sensor_msgs::Image foreign = depth_message(10.3);
  foreign.encoding = "8UC1";
  Handmade(path_)
      .add_camera_and_motion()
      .add("/depth/camera_info", 10.5, info)
      .add("/depth/image", 10.1, depth_message(10.1))
      .add("/depth/image", 10.2, truncated)
      .add("/depth/image", 10.3, foreign)
      .add("/depth/image", 10.6, depth_message(10.6));
  const auto source = open_source(path_);
  EXPECT_EQ(read_all(*source).size(), 1u);
  ASSERT_EQ(source->skipped().size(), 3u);
  EXPECT_TRUE(says(source->skipped()[0], "23 bytes instead of 24"));
  EXPECT_TRUE(says(source->skipped()[1], "8UC1"));
  EXPECT_TRUE(says(source->skipped()[2], "640x3"));
}

TEST_F(BagTest, ColourIsTheNearestWithinThirtyMilliseconds) {
  {
    Handmade bag(path_);
    bag.add_camera_and_motion();
    for (const double stamp : {10.1, 10.2, 10.3}) bag.add("/depth/image", stamp, depth_message(stamp));
    bag.add("/rgb/image", 10.0, color_message(10.08, "rgb8", {1, 2, 3}));
    bag.add("/rgb/image", 10.0, color_message(10.11, "rgb8", {4, 5, 6}));
    bag.add("/rgb/image", 10.5, color_message(10.171, "rgb8", {7, 8, 9}));
    bag.add("/rgb/image", 10.6, color_message(10.331, "rgb8", {10, 11, 12}));
  }
  const auto source = open_source(path_);
  const std::vector<RecordedFrame> frames = read_all(*source);
  ASSERT_EQ(frames.size(), 3u);
  ASSERT_FALSE(frames[0].color.empty());
  EXPECT_EQ(frames[0].color.at<cv::Vec3b>(1, 1), cv::Vec3b(6, 5, 4));
  ASSERT_FALSE(frames[1].color.empty());
  EXPECT_EQ(frames[1].color.at<cv::Vec3b>(1, 1), cv::Vec3b(9, 8, 7));
  EXPECT_TRUE(frames[2].color.empty()) << "31 ms are too far";
  EXPECT_TRUE(says(source->notes().back(), "30 ms"));
}

TEST_F(BagTest, ColourOfAnotherSizeIsNotUsed) {
  sensor_msgs::Image large = color_message(10.5, "rgb8", {1, 2, 3});
  large.height = 1;
  large.data.resize(large.step);
  {
    Handmade bag(path_);
    bag.add_camera_and_motion().add("/depth/image", 10.5, depth_message(10.5)).add("/rgb/image", 10.5, large);
  }
  EXPECT_TRUE(open_source(path_)->next()->color.empty());
  SourceOptions options;
  options.color_topic = "/rgb/image";
  const auto source = open_source(path_, options);
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->color.empty());
  EXPECT_TRUE(says(source->notes().back(), "another size"));
}

TEST_F(BagTest, ListsTheCandidatesWhenTopicsAreAmbiguous) {
  Handmade(path_)
      .add_camera_and_motion()
      .add("/depth/image", 10.5, depth_message(10.5))
      .add("/depth/image_raw", 10.5, depth_message(10.5))
      .add("/ir/image", 10.5, depth_message(10.5));
  EXPECT_TRUE(says(failure(), "/depth/image, /depth/image_raw"));
  EXPECT_FALSE(says(failure(), "/ir/image")) << "names with 'depth' are preferred";
  SourceOptions options;
  options.depth_topic = "depth/image_raw";
  EXPECT_TRUE(open_source(path_, options)->next());
  options.depth_topic = "/depth/nothing";
  EXPECT_TRUE(says(failure(options), "/depth/nothing"));
  EXPECT_TRUE(says(failure(options), "/ir/image"));

  Handmade(path_)
      .add_camera_and_motion()
      .add("/depth/image", 10.5, depth_message(10.5))
      .add("/rgb/image", 10.5, color_message(10.5, "rgb8", {1, 2, 3}))
      .add("/color/image", 10.5, color_message(10.5, "rgb8", {1, 2, 3}));
  EXPECT_TRUE(says(failure(), "/color/image, /rgb/image"));
  options = {};
  options.color_topic = "none";
  EXPECT_TRUE(open_source(path_, options)->next()->color.empty());
}

TEST_F(BagTest, SaysWhatIsWrongWithFiles) {
  std::ofstream(path_).close();
  EXPECT_TRUE(says(failure(), "empty"));
  std::ofstream(path_) << "PK, and other things that no bag begins with";
  EXPECT_TRUE(says(failure(), "no bag of ROS 1"));
  std::ofstream(path_) << "#ROSBAG V1.2\n";
  EXPECT_TRUE(says(failure(), "rosbag fix"));
  Handmade(path_).add("/chatter", 10, depth_message(10).header);
  EXPECT_TRUE(says(failure(), "no depth images"));
}

TEST_F(BagTest, NoTruncatedBagIsReadOrCrashes) {
  {
    Handmade bag(path_);
    bag.add_camera_and_motion();
    for (int i = 0; i < 20; ++i) bag.add("/depth/image", 10 + 0.01 * i, depth_message(10 + 0.01 * i));
  }
  const auto size = fs::file_size(path_);
  for (const double share : {0.999, 0.9, 0.5, 0.1, 0.01}) {
    fs::resize_file(path_, static_cast<std::uintmax_t>(share * static_cast<double>(size)));
    EXPECT_TRUE(says(failure(), "rosbag reindex")) << "at " << share;
  }
}

TEST_F(BagTest, BagThatIsStillRecordedNeedsReindexing) {
  rosbag::Bag bag(path_, rosbag::bagmode::Write);
  bag.write("/depth/image", ros::Time(10), depth_message(10));
  EXPECT_TRUE(says(failure(), "rosbag reindex"));
}

// ---- Single messages ----

ImageMessage raw(const sensor_msgs::Image& image) { return {boost::make_shared<sensor_msgs::Image>(image), nullptr}; }

ImageMessage compressed(const std::string& format, const cv::Mat& image, const std::vector<float>& header = {},
                        const char* extension = ".png") {
  const auto message = boost::make_shared<sensor_msgs::CompressedImage>();
  message->format = format;
  cv::imencode(extension, image, message->data);
  std::vector<std::uint8_t> bytes(4 * header.size());
  if (!header.empty()) std::memcpy(bytes.data(), header.data(), bytes.size());
  message->data.insert(message->data.begin(), bytes.begin(), bytes.end());
  return {nullptr, message};
}

TEST(DepthMessages, RespectStepAndByteOrder) {
  sensor_msgs::Image image = depth_message(10);
  image.step = 11;
  image.is_bigendian = 1;
  image.data.assign(image.step * kHeight, 0xff);
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      image.data[static_cast<std::size_t>(11 * row + 2 * column)] = 4;
      image.data[static_cast<std::size_t>(11 * row + 2 * column + 1)] = static_cast<std::uint8_t>(10 * row + column);
    }
  }
  for (const char* encoding : {"16UC1", "mono16"}) {
    image.encoding = encoding;
    const cv::Mat depth = depth_image(raw(image));
    ASSERT_EQ(depth.type(), CV_16UC1);
    EXPECT_EQ(depth.at<std::uint16_t>(0, 0), 1024);
    EXPECT_EQ(depth.at<std::uint16_t>(2, 3), 1024 + 23);
  }

  image.encoding = "32FC1";
  image.step = 4 * kWidth;
  image.data.clear();
  for (int i = 0; i < kWidth * kHeight; ++i) image.data.insert(image.data.end(), {0x3f, 0xc0, 0, 0});  // 1.5, big end first
  const cv::Mat depth = depth_image(raw(image));
  ASSERT_EQ(depth.type(), CV_32FC1);
  EXPECT_EQ(depth.at<float>(2, 3), 1.5f);
}

TEST(DepthMessages, RefuseWhatIsMalformed) {
  sensor_msgs::Image image = depth_message(10);
  image.step = 7;  // less than a row
  image.data.resize(7 * kHeight);
  EXPECT_THROW(depth_image(raw(image)), BadFrame);
  image = depth_message(10);
  image.width = 0;
  EXPECT_THROW(depth_image(raw(image)), BadFrame);
  image = depth_message(10);
  image.width = image.height = image.step = 1u << 16;  // their product is 0 in 32 bits
  image.data.clear();
  EXPECT_THROW(depth_image(raw(image)), BadFrame);
  image = depth_message(10);
  image.encoding = "rgb8";
  EXPECT_THROW(depth_image(raw(image)), BadFrame);
}

TEST(DepthMessages, CompressedOnes) {
  cv::Mat values(kHeight, kWidth, CV_16UC1, cv::Scalar(2020));
  values.at<std::uint16_t>(0, 0) = 0;
  EXPECT_TRUE(same_bytes(depth_image(compressed("png", values)), values));
  EXPECT_TRUE(same_bytes(depth_image(compressed("16UC1; compressedDepth", values, {0, 0, 0})), values));
  EXPECT_TRUE(same_bytes(depth_image(compressed("16UC1; compressedDepth png", values, {0, 0, 0})), values));

  const cv::Mat metres = depth_image(compressed("32FC1; compressedDepth", values, {0, 10100, -1010}));
  ASSERT_EQ(metres.type(), CV_32FC1);
  EXPECT_TRUE(std::isnan(metres.at<float>(0, 0)));
  EXPECT_FLOAT_EQ(metres.at<float>(1, 1), 10100.0f / (2020 + 1010));

  EXPECT_THROW(depth_image(compressed("jpeg", cv::Mat(3, 4, CV_8UC3), {}, ".jpg")), BadFrame);
  EXPECT_THROW(depth_image(compressed("16UC1; compressedDepth rvl", values, {0, 0, 0})), BadFrame);
  EXPECT_THROW(depth_image(compressed("16UC1; compressedDepth", values)), BadFrame) << "no header: the image is cut";
  sensor_msgs::CompressedImage empty;
  EXPECT_THROW(depth_image({nullptr, boost::make_shared<sensor_msgs::CompressedImage>(empty)}), BadFrame);
}

TEST(ColourMessages, AllOrdersBecomeBgr) {
  const cv::Vec3b bgr(30, 20, 10);
  EXPECT_EQ(color_image(raw(color_message(1, "rgb8", {10, 20, 30}))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_EQ(color_image(raw(color_message(1, "bgr8", {30, 20, 10}))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_EQ(color_image(raw(color_message(1, "rgba8", {10, 20, 30, 99}))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_EQ(color_image(raw(color_message(1, "bgra8", {30, 20, 10, 99}))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_EQ(color_image(raw(color_message(1, "mono8", {77}))).at<cv::Vec3b>(2, 3), cv::Vec3b(77, 77, 77));
  EXPECT_EQ(color_image(compressed("bgr8; png compressed bgr8", cv::Mat(3, 4, CV_8UC3, cv::Scalar(30, 20, 10)))).at<cv::Vec3b>(2, 3), bgr);
  EXPECT_THROW(color_image(raw(color_message(1, "nonsense", {1}))), BadFrame);
}

TEST(CameraMessages, RectifiedBinnedAndCropped) {
  sensor_msgs::CameraInfo info = info_message(1);
  EXPECT_EQ(to_intrinsics(info).fy, 6) << "no P: K";
  info.width = 640;
  info.height = 480;
  info.P = {500, 0, 320, 0, 0, 490, 240, 0, 0, 0, 1, 0};
  EXPECT_EQ(to_intrinsics(info).fx, 500);
  EXPECT_EQ(to_intrinsics(info).width, 640);

  info.roi.x_offset = 100;
  info.roi.y_offset = 40;
  info.roi.width = 400;
  info.roi.height = 200;
  info.binning_x = 4;
  info.binning_y = 2;
  const Intrinsics intrinsics = to_intrinsics(info);
  EXPECT_EQ(intrinsics.fx, 125);
  EXPECT_EQ(intrinsics.fy, 245);
  EXPECT_EQ(intrinsics.cx, 55);
  EXPECT_EQ(intrinsics.cy, 100);
  EXPECT_EQ(intrinsics.width, 100);
  EXPECT_EQ(intrinsics.height, 100);

  info.P[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(to_intrinsics(info), BadFrame);
  EXPECT_THROW(to_intrinsics(sensor_msgs::CameraInfo()), BadFrame);
}

}  // namespace
