// Which messages of a bag are sent to a running mapper for a frame. Compared with the slow obvious way: those that the frame is made of.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "bag_input.hpp"
#include "recordings/bag_streams.hpp"
#include "recordings/bag_topics.hpp"

namespace frontier_surfels::replay {
namespace {

using Stamps = std::vector<double>;

class BagStreams : public BagTest {
 protected:
  const rosbag::Bag& bag() {
    if (!bag_.isOpen()) bag_.open(path_, rosbag::bagmode::Read);
    return bag_;
  }

  rosbag::Bag bag_;
};

double stamp_of(const rosbag::MessageInstance& message) {
  if (const ImageMessage image = to_image_message(message)) return image.header().stamp.toSec();
  return message.instantiate<sensor_msgs::CameraInfo>()->header.stamp.toSec();
}

Stamps stamps_of(const tf2_msgs::TFMessage& message) {
  Stamps stamps;
  for (const auto& transform : message.transforms) stamps.push_back(transform.header.stamp.toSec());
  return stamps;
}

Stamps take(ColorStream& stream, double stamp) {
  Stamps stamps;
  for (const auto& image : stream.take(ros::Time(stamp))) stamps.push_back(stamp_of(image));
  return stamps;
}

double take(CameraStream& stream, double stamp) {
  const auto camera = stream.take(ros::Time(stamp));
  return camera ? stamp_of(*camera) : 0;
}

TEST_F(BagStreams, TransformsComeInOneMessageByTheTimeOfTheBag) {
  Handmade(path_)
      .add("/tf", 10, tf_message(9.5, "a", "b", 0))
      .add("/tf", 11, tf_message(12, "a", "b", 0))
      .add("tf", 11.5, tf_message(11.25, "a", "c", 0))
      .add_of_old_type("/tf", 12, tf_message(10.5, "a", "b", 0))
      .add("/tf_static", 11, tf_message(1, "d", "e", 0));
  TransformStream stream(bag(), "tf"), constant(bag(), "tf_static");
  EXPECT_EQ(stamps_of(stream.take(ros::Time(9))), Stamps());
  EXPECT_EQ(stamps_of(stream.take(ros::Time(11.5))), (Stamps{9.5, 12, 11.25}));
  EXPECT_EQ(stamps_of(stream.take(ros::Time(11.75))), Stamps());
  EXPECT_EQ(stamps_of(stream.take(ros::Time(20))), (Stamps{10.5}));
  EXPECT_EQ(stamps_of(constant.take(ros::TIME_MAX)), (Stamps{1}));
}

TEST_F(BagStreams, MessagesWithoutATimeAreLeftOut) {
  const ros::Time no_time(4294967295, 999999999);
  sensor_msgs::Image color = color_message(10, "rgb8", {1, 2, 3});
  sensor_msgs::CameraInfo info = info_message(10);
  tf2_msgs::TFMessage transform = tf_message(10, "a", "b", 0);
  color.header.stamp = info.header.stamp = transform.transforms[0].header.stamp = no_time;
  Handmade(path_)
      .add("/info", 10, info_message(10))
      .add("/info", 10.1, info)
      .add("/info", 10.2, info_message(10.2))
      .add("/rgb", 10, color)
      .add("/rgb", 10.2, color_message(10.2, "rgb8", {1, 2, 3}))
      .add("/tf", 10, transform)
      .add("/tf", 10.2, tf_message(10.2, "a", "b", 0))
      .add("/tf_static", 10, transform)
      .close();
  CameraStream cameras(bag(), "/info");
  EXPECT_EQ(take(cameras, 10), 10);
  EXPECT_EQ(take(cameras, 11), 10.2);
  ColorStream colors(bag(), "/rgb");
  EXPECT_EQ(take(colors, 10.1), (Stamps{10.2}));
  TransformStream moving(bag(), "tf"), constant(bag(), "tf_static");
  EXPECT_EQ(stamps_of(moving.take(ros::TIME_MAX)), (Stamps{10.2}));
  EXPECT_EQ(constant.take(ros::TIME_MAX).transforms.size(), 1u) << "the stamp of a static transform has no meaning";
}

TEST_F(BagStreams, RotationsThatAreNearlyOnesAreCorrectedAsOffline) {
  tf2_msgs::TFMessage nearly = tf_message(10, "a", "b", 0), damaged = nearly;
  nearly.transforms[0].transform.rotation.w = 1.005;
  damaged.transforms[0].transform.rotation.w = 0.5;
  Handmade(path_).add("/tf", 10, nearly).add("/tf", 10, damaged);
  TransformStream stream(bag(), "tf");
  const auto all = stream.take(ros::TIME_MAX).transforms;
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].transform.rotation.w, 1);
  EXPECT_EQ(all[1].transform.rotation.w, 0.5) << "tf itself must refuse it";
}

TEST_F(BagStreams, CamerasAreThoseAtOrBeforeTheFrame) {
  {
    Handmade bag_file(path_);
    for (const double stamp : {10.0, 11.0, 11.5, 12.0, 15.0}) bag_file.add("/info", stamp, info_message(stamp));
  }
  CameraStream stream(bag(), "/info");
  EXPECT_EQ(take(stream, 9), 10) << "the first one is used before its stamp";
  EXPECT_EQ(take(stream, 9.5), 0) << "it was returned before";
  EXPECT_EQ(take(stream, 11.75), 11.5) << "11 is not the last one before the stamp";
  EXPECT_EQ(take(stream, 12), 12);
  EXPECT_EQ(take(stream, 14.9), 0);
  EXPECT_EQ(take(stream, 99), 15);
  EXPECT_EQ(take(stream, 99), 0);
}

TEST_F(BagStreams, ColoursAreThoseAroundTheFrame) {
  {
    Handmade bag_file(path_);
    for (const double stamp : {10.0, 10.25, 10.5, 10.75, 11.0, 11.25}) bag_file.add("/rgb", stamp, color_message(stamp, "rgb8", {1, 2, 3}));
  }
  ColorStream stream(bag(), "/rgb");
  EXPECT_EQ(take(stream, 10.3), (Stamps{10.25, 10.5}));
  EXPECT_EQ(take(stream, 10.4), Stamps()) << "both were returned before";
  EXPECT_EQ(take(stream, 10.5), Stamps());
  EXPECT_EQ(take(stream, 10.75), (Stamps{10.75})) << "none before it can be nearer";
  EXPECT_EQ(take(stream, 12), (Stamps{11.25}));
  EXPECT_EQ(take(stream, 13), Stamps());
}

TEST_F(BagStreams, TheColourNearestOfAllIsAlwaysAmongThoseSent) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> step(1, 9);
    const auto make_stamps = [&](int count) {
      Stamps stamps;
      for (int i = 0, ticks = 0; i < count; ++i) stamps.push_back(10 + (ticks += step(random)) / 64.0);  // exact in binary
      return stamps;
    };
    const Stamps colors = make_stamps(40), frames = make_stamps(40);
    path_ = (folder_ / ("random" + std::to_string(seed) + ".bag")).string();
    {
      Handmade bag_file(path_);
      for (const double stamp : colors) bag_file.add("/rgb", stamp, color_message(stamp, "rgb8", {1, 2, 3}));
    }
    rosbag::Bag bag(path_);
    ColorStream stream(bag, "/rgb");
    Stamps sent;
    const auto nearest = [](const Stamps& stamps, double frame) {
      double least = std::numeric_limits<double>::infinity();
      for (const double stamp : stamps) least = std::min(least, std::abs(stamp - frame));
      return least;
    };
    for (const double frame : frames) {
      const Stamps more = take(stream, frame);
      EXPECT_LE(more.size(), 2u) << "a mapper's queue is short";
      sent.insert(sent.end(), more.begin(), more.end());
      EXPECT_EQ(nearest(sent, frame), nearest(colors, frame)) << "seed " << seed << ", frame at " << frame;
    }
  }
}

}  // namespace
}  // namespace frontier_surfels::replay
