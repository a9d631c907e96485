/// Reading of bags: all kinds of transforms, colour, topics, and every fault of a file.
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "replay/run.hpp"
#include "replay/warnings.hpp"
#include "ros/bag_input.hpp"

namespace frontier_surfels::replay {
namespace {

testing::AssertionResult says(const std::string& sentence, const std::string& part) {
  if (sentence.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << part << "' is not in '" << sentence << "'";
}

/// The warnings of a report about a run with the frames of this source.
std::vector<std::string> reported(const FrameSource& source) {
  Run run;
  finish_run(source, run);
  return warnings(run);
}

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

TEST_F(BagTest, AnEmptyFrameIdIsNamed) {
  for (const char* name : {"", "/"}) {
    sensor_msgs::Image nameless = depth_message(10.25);
    nameless.header.frame_id = name;
    Handmade(path_).add_camera_and_motion().add("/depth/image", 10.25, nameless);
    EXPECT_TRUE(says(failure(), "The frame_id of the first image on /depth/image is empty: its driver must set it")) << failure();
    Handmade(path_).add_camera_and_motion().add("/depth/image", 10, depth_message(10)).add("/depth/image", 10.25, nameless);
    const auto source = open_source(path_);
    EXPECT_EQ(read_all(*source).size(), 1u);
    ASSERT_EQ(source->skipped().size(), 1u);
    EXPECT_TRUE(says(source->skipped()[0], "its frame_id is empty")) << source->skipped()[0];
  }
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

/// The largest time, which some drivers write for "no time".
ros::Time no_time() { return ros::Time(4294967295, 999999999); }

TEST_F(BagTest, TransformsWithoutATimeAreLeftOut) {
  tf2_msgs::TFMessage moving = tf_message(10.5, "world", "camera", 7), other = tf_message(10.5, "world", "robot", 7);
  moving.transforms[0].header.stamp = other.transforms[0].header.stamp = no_time();
  for (const double time : {9.0, 10.5, 12.0}) {  // before, between and after the others
    Handmade bag(path_);
    if (time < 10) bag.add("/tf", time, moving);
    bag.add_camera_and_motion().add("/tf", 10.2, other);
    if (time > 10) bag.add("/tf", time, moving);
    bag.add("/tf", 12.5, tf_message(12, "world", "camera", 2)).add("/depth/image", 10.5, depth_message(10.5));
    bag.add("/depth/image", 11.5, depth_message(11.5)).close();
    const auto source = open_source(path_);
    const auto frames = read_all(*source);
    ASSERT_EQ(frames.size(), 2u) << source->skipped().front();
    EXPECT_NEAR(frames[0].T_world_camera.translation().x(), 0.5, 1e-9);
    EXPECT_NEAR(frames[1].T_world_camera.translation().x(), 1.5, 1e-9);
    EXPECT_TRUE(says(source->notes().front(), "2 transforms"));
    EXPECT_TRUE(says(source->notes().front(), "2038"));
  }
}

TEST_F(BagTest, OtherMessagesWithoutATimeDoNoHarm) {
  sensor_msgs::Image depth = depth_message(10.5), color = color_message(10.5, "bgr8", {1, 2, 3});
  sensor_msgs::CameraInfo info = info_message(10);
  depth.header.stamp = color.header.stamp = info.header.stamp = no_time();
  tf2_msgs::TFMessage fixed = tf_message(10, "base", "camera", 0);
  fixed.transforms[0].header.stamp = no_time();
  Handmade bag(path_);
  bag.add("/depth/image", 10.4, depth).add("/rgb/image", 10.4, color).add("/depth/camera_info", 10.4, info);
  bag.add("/depth/image", 10.5, depth_message(10.5)).add("/rgb/image", 10.5, color_message(10.5, "bgr8", {4, 5, 6}));
  bag.add("/depth/camera_info", 10, info_message(10));
  bag.add("/tf", 10, tf_message(10, "world", "base", 0)).add("/tf", 11, tf_message(11, "world", "base", 1)).add("/tf_static", 10, fixed);
  bag.add_at("/tf", no_time(), tf_message(11.5, "world", "base", 3)).add_at("/depth/image", no_time(), depth_message(11.25)).close();
  const auto source = open_source(path_);
  const auto frames = read_all(*source);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_NEAR(frames[0].T_world_camera.translation().x(), 0.5, 1e-9);
  EXPECT_NEAR(frames[1].T_world_camera.translation().x(), 2, 1e-9);
  EXPECT_FALSE(frames[0].color.empty());
  ASSERT_EQ(source->skipped().size(), 1u);
  EXPECT_TRUE(says(source->skipped()[0], "4294967295 s is later than in 2038"));
}

TEST_F(BagTest, ImpossibleQuantisationIsNamed) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const auto& [a, b] : {std::pair(0.0F, 0.0F),
                             {nan, 1.0F},
                             {1.0F, nan},
                             {std::numeric_limits<float>::infinity(), 0.0F},
                             {-100.0F, 0.0F},
                             {100.0F, 65535.0F}}) {
    Handmade(path_).add_camera_and_motion().add("/depth/image/compressedDepth", 10, compressed_depth(10, a, b));
    EXPECT_TRUE(says(failure(), "/depth/image/compressedDepth cannot be used: its depth quantisation"));
    Handmade(path_)
        .add_camera_and_motion()
        .add("/depth/image/compressedDepth", 10, compressed_depth(10, 100, 0))
        .add("/depth/image/compressedDepth", 10.5, compressed_depth(10.5, a, b));
    const auto source = open_source(path_);
    EXPECT_EQ(read_all(*source).size(), 1u);
    ASSERT_EQ(source->skipped().size(), 1u);
    EXPECT_TRUE(says(source->skipped()[0], "quantisation"));
  }
}

TEST_F(BagTest, DistortionWithoutPIsToldOnce) {
  sensor_msgs::CameraInfo info = info_message(10);
  for (const bool distorts : {false, true}) {
    info.D.assign(5, distorts ? 0.1 : 0);
    Handmade(path_)
        .add("/depth/camera_info", 10, info)
        .add("/tf", 10, tf_message(10, "world", "camera", 0))
        .add("/tf", 11, tf_message(11, "world", "camera", 1))
        .add("/depth/image", 10.25, depth_message(10.25))
        .add("/depth/image", 10.5, depth_message(10.5));
    const auto source = open_source(path_);
    EXPECT_EQ(read_all(*source).size(), 2u);
    const std::vector<std::string> warnings = reported(*source);
    ASSERT_EQ(warnings.size(), distorts ? 1u : 0u);
    for (const std::string& warning : warnings)
      EXPECT_TRUE(says(warning, "taken as rectified, with K. If they are not, choose with --depth-topic"));
  }
}

TEST_F(BagTest, AlternatingSizesAreToldOnce) {
  Handmade bag(path_);
  bag.add("/tf", 10, tf_message(10, "world", "camera", 0)).add("/tf", 11, tf_message(11, "world", "camera", 1));
  for (int n = 0; n < 8; ++n) {
    const double stamp = 10 + 0.1 * n;
    sensor_msgs::CameraInfo info = info_message(stamp);
    sensor_msgs::Image image = depth_message(stamp);
    if (n % 2 == 1) {  // of a smaller camera
      info.height = image.height = kHeight - 1;
      image.data.resize(image.step * image.height);
    }
    bag.add("/depth/camera_info", stamp, info).add("/depth/image", stamp, image);
  }
  bag.close();
  const auto source = open_source(path_);
  EXPECT_EQ(read_all(*source).size(), 8u);
  const std::vector<std::string> warnings = reported(*source);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(says(warnings[0], "4x3 and of 4x2 pixels alternate: do two cameras publish on the topic? Choose the topics"));
}

TEST_F(BagTest, AStillCameraGetsAListOfTheTransforms) {
  Handmade(path_)
      .add("/depth/camera_info", 10, info_message(10))
      .add("/tf_static", 10, tf_message(10, "base", "camera", 1))
      .add("/tf", 10, tf_message(10, "map", "odom", 1))
      .add("/depth/image", 10, depth_message(10));
  const auto source = open_source(path_);
  EXPECT_EQ(source->world_frame(), "base");
  EXPECT_TRUE(says(source->if_still(), "map -> odom"));
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
  std::ofstream(path_) << "PK, with which no bag begins";
  EXPECT_TRUE(says(failure(), "not a bag of ROS 1"));
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

}  // namespace
}  // namespace frontier_surfels::replay
