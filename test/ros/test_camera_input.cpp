/// Cameras of one mapper, without subscriptions: messages and transforms are put in by hand.
#include <frontier_surfels/FrameReport.h>
#include <gtest/gtest.h>
#include <sensor_msgs/image_encodings.h>

#include <boost/make_shared.hpp>
#include <map>
#include <string>
#include <vector>

#include "ros/bag_input.hpp"
#include "ros/input/camera_input.hpp"

namespace frontier_surfels {
namespace {

using replay::color_message;
using replay::depth_message;
using replay::info_message;
using replay::kHeight;
using replay::kWidth;

NodeConfig config_of(double tf_timeout) {
  NodeConfig config;
  config.tf_timeout = tf_timeout;
  return config;
}

/// A camera, and what it tells.
struct TestCamera {
  TestCamera(FramePoses& poses, const std::string& name, double tf_timeout = 10)
      : input(config_of(tf_timeout), {name + "/image", name + "/camera_info", name + "/color"}, poses,
              {[this] { ++ready; }, [this](const DroppedImage& image) { dropped.push_back(image); }}) {}

  /// @param wait  how much later than now it arrives
  void add(const sensor_msgs::Image& image, Clock::duration wait = {}) {
    input.add_depth({{boost::make_shared<sensor_msgs::Image>(image), nullptr}, Clock::now() + wait});
  }

  void add_color(const sensor_msgs::Image& image) { input.add_color({boost::make_shared<sensor_msgs::Image>(image), nullptr}); }

  void add_info(const sensor_msgs::CameraInfo& info) { input.add_info(boost::make_shared<sensor_msgs::CameraInfo>(info)); }

  int ready = 0;
  std::vector<DroppedImage> dropped;
  CameraInput input;
};

class CameraInputs : public testing::Test {
 protected:
  void SetUp() override {
    ros::Time::init();
    for (const char* frame : {"left", "right"}) set_transform(0, frame, true);
  }

  void set_transform(double stamp, const std::string& frame, bool is_static) {
    geometry_msgs::TransformStamped transform = replay::tf_message(stamp, "map", frame, stamp).transforms[0];
    poses_.buffer().setTransform(transform, "test", is_static);
  }

  static sensor_msgs::Image image_of(const std::string& frame, double stamp) {
    sensor_msgs::Image image = depth_message(stamp);
    image.header.frame_id = frame;
    return image;
  }

  FramePoses poses_{"map"};
};

TEST_F(CameraInputs, TheMapperReadsTheMessagesOwnBytes) {
  TestCamera camera(poses_, "left");
  camera.add_info(info_message(10));
  camera.add_color(color_message(10, "rgb8", {1, 2, 3}));
  camera.add(image_of("left", 10));
  EXPECT_EQ(camera.ready, 1);
  EXPECT_EQ(camera.input.next_stamp(), ros::Time(10));
  const std::optional<CompleteImage> image = camera.input.take();
  ASSERT_TRUE(image);
  const CameraFrame frame(*image);
  const DepthFrame view = frame.view();
  EXPECT_EQ(view.stamp, 10);
  EXPECT_EQ(view.depth.data, image->arrival.image.raw->data.data());
  ASSERT_TRUE(view.color);
  EXPECT_EQ(view.color->data, image->color.raw->data.data());
  EXPECT_EQ(view.intrinsics.fx, 5);
  EXPECT_EQ(view.intrinsics.width, kWidth);
  EXPECT_EQ(view.intrinsics.height, kHeight);
  EXPECT_FALSE(camera.input.next_stamp() || camera.input.take());
}

TEST_F(CameraInputs, SayWhyColourIsNotUsed) {
  TestCamera camera(poses_, "left");
  camera.add_info(info_message(10));
  sensor_msgs::Image larger = color_message(10, "rgb8", {1, 2, 3}), unknown = color_message(11, "rgb9", {1, 2, 3});
  larger.height *= 2;
  larger.data.insert(larger.data.end(), larger.data.begin(), larger.data.end());
  for (const sensor_msgs::Image& color : {larger, unknown, color_message(12, "rgb8", {1, 2, 3})}) camera.add_color(color);
  std::string faults[3];
  for (std::string& fault : faults) {
    camera.add(image_of("left", 10.0 + static_cast<double>(&fault - faults)));
    const std::optional<CompleteImage> image = camera.input.take();
    ASSERT_TRUE(image);
    const CameraFrame frame(*image);
    fault = frame.color_fault();
    EXPECT_EQ(frame.view().color.has_value(), fault.empty());
  }
  EXPECT_NE(faults[0].find("4x6 pixels, the depth images 4x3"), std::string::npos) << faults[0];
  EXPECT_NE(faults[1].find("'rgb9'"), std::string::npos) << faults[1];
  EXPECT_EQ(faults[2], "");
}

TEST_F(CameraInputs, DoNotDisturbEachOthersStampsAndCameras) {
  TestCamera left(poses_, "left"), right(poses_, "right");
  left.add_info(info_message(1, 5));
  right.add_info(info_message(1, 50));
  for (const double stamp : {100.0, 101.0}) left.add(image_of("left", stamp));
  right.add(image_of("right", 50));  // would be out of order, or a jump, for the left camera
  right.add(image_of("right", 51));
  for (TestCamera* camera : {&left, &right}) {
    EXPECT_TRUE(camera->dropped.empty());
    EXPECT_EQ(camera->ready, 2);
    while (const std::optional<CompleteImage> image = camera->input.take())
      EXPECT_EQ(CameraFrame(*image).view().intrinsics.fx, camera == &left ? 5 : 50);
  }

  // A jump of one of them is none of the other.
  left.add(image_of("left", 90));
  right.add(image_of("right", 51.5));
  right.add(image_of("right", 51.25));
  EXPECT_TRUE(left.dropped.empty());
  EXPECT_EQ(left.input.next_stamp(), ros::Time(90));
  ASSERT_EQ(right.dropped.size(), 1U);
  EXPECT_EQ(right.dropped[0].result, FrameReport::DROPPED_OUT_OF_ORDER);

  right.input.pause(true);
  right.input.reset();
  EXPECT_EQ(left.input.next_stamp(), ros::Time(90));
  left.input.set_last_mapped(ros::Time(90));
  EXPECT_EQ(right.input.last_mapped(), ros::Time());
}

TEST_F(CameraInputs, WaitForPoseAndCamera) {
  TestCamera camera(poses_, "left");
  camera.add(image_of("moving", 10));
  EXPECT_EQ(camera.ready, 0);
  set_transform(10, "moving", false);
  camera.input.look_through();
  EXPECT_EQ(camera.ready, 0) << "there is no camera_info yet";
  camera.add_info(info_message(10));
  camera.input.look_through();
  EXPECT_EQ(camera.ready, 1);
  const std::optional<CompleteImage> image = camera.input.take();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->T_world_camera.translation().x(), 10);
  EXPECT_TRUE(camera.dropped.empty());
}

TEST_F(CameraInputs, SayWhatWasMissing) {
  TestCamera camera(poses_, "left", 0);
  const auto check = [&](std::uint8_t result, const std::string& part) {
    ASSERT_EQ(camera.dropped.size(), 1U);
    EXPECT_EQ(camera.dropped[0].result, result);
    EXPECT_NE(camera.dropped[0].reason.find(part), std::string::npos) << camera.dropped[0].reason;
    camera.dropped.clear();
  };
  camera.add(image_of("left", 10));
  check(FrameReport::DROPPED_NO_CAMERA, "left/camera_info");
  camera.add_info(info_message(10));
  camera.add(image_of("nowhere", 10));
  check(FrameReport::DROPPED_NO_POSE, "'nowhere'");
  camera.add(image_of("map", 10));
  check(FrameReport::DROPPED_NO_POSE, "world frame");
  camera.add(image_of("", 10));
  check(FrameReport::DROPPED_NO_POSE, "frame_id");
  camera.add(image_of("left", 0));
  check(FrameReport::DROPPED_NO_POSE, "stamp is 0");
  sensor_msgs::Image damaged = image_of("left", 10);
  damaged.data.pop_back();
  camera.add(damaged);
  check(FrameReport::DROPPED_BAD_IMAGE, "23 bytes");
  EXPECT_EQ(camera.ready, 0);
}

TEST_F(CameraInputs, DropAtOnceWhatCanNeverHaveAPose) {
  TestCamera camera(poses_, "left");
  camera.add(image_of("", 10));
  camera.add(image_of("/", 10));
  ASSERT_EQ(camera.dropped.size(), 2U);
  for (const DroppedImage& image : camera.dropped) {
    EXPECT_EQ(image.result, FrameReport::DROPPED_NO_POSE);
    EXPECT_NE(image.reason.find("frame_id is empty"), std::string::npos) << image.reason;
  }
}

TEST_F(CameraInputs, RefuseImagesWhoseStampCannotBeATime) {
  TestCamera camera(poses_, "left");
  camera.add_info(info_message(10));
  camera.add(image_of("left", 10));
  ASSERT_TRUE(camera.input.take());
  camera.add(image_of("nowhere", 11));  // waits
  for (const ros::Time& stamp : {ros::Time(2147483648U, 0), ros::Time(4000000000U, 0), ros::TIME_MAX}) {
    sensor_msgs::Image image = image_of("left", 10);
    image.header.stamp = stamp;
    camera.add(image);
    ASSERT_EQ(camera.dropped.size(), 1U) << stamp;
    EXPECT_EQ(camera.dropped[0].result, FrameReport::DROPPED_NO_POSE);
    for (const std::string& part :
         {"stamp of " + std::to_string(stamp.sec) + " s is later than in 2038", std::string("correct the camera's driver")})
      EXPECT_NE(camera.dropped[0].reason.find(part), std::string::npos) << camera.dropped[0].reason;
    camera.dropped.clear();
  }
  camera.add(image_of("left", 10.5));
  EXPECT_TRUE(camera.dropped.empty()) << "there was no jump of time";
  EXPECT_EQ(camera.input.next_stamp(), ros::Time(10.5));
}

TEST_F(CameraInputs, LeaveOutColourWhoseStampCannotBeATime) {
  TestCamera camera(poses_, "left");
  camera.add_info(info_message(10));
  sensor_msgs::Image timeless = color_message(10, "rgb8", {1, 2, 3});
  timeless.header.stamp = ros::TIME_MAX;
  for (const sensor_msgs::Image& color : {color_message(9.9, "rgb8", {1, 2, 3}), timeless}) camera.add_color(color);
  camera.add(image_of("left", 10), std::chrono::hours(1));
  EXPECT_EQ(camera.ready, 0) << "colour of this time may still come";
}

TEST_F(CameraInputs, UseACameraInfoWhoseStampCannotBeATimeOnlyWhileThereIsNone) {
  TestCamera camera(poses_, "left");
  const auto focal_length_at = [&](double stamp) {
    camera.add(image_of("left", stamp));
    const std::optional<CompleteImage> image = camera.input.take();
    return image ? CameraFrame(*image).view().intrinsics.fx : 0;
  };
  const auto add_timeless = [&](double focal_length) {
    sensor_msgs::CameraInfo info = info_message(10, focal_length);
    info.header.stamp = ros::TIME_MAX;
    camera.add_info(info);
  };
  add_timeless(5);
  EXPECT_EQ(focal_length_at(9), 5);
  camera.add_info(info_message(10, 6));
  EXPECT_EQ(focal_length_at(9.5), 6) << "the earliest of those with a time";
  add_timeless(7);
  EXPECT_EQ(focal_length_at(11), 6);
  camera.add_info(info_message(12, 8));
  EXPECT_EQ(focal_length_at(11.5), 6);
  EXPECT_EQ(focal_length_at(12), 8);
}

TEST_F(CameraInputs, WaitForColourThatIsDue) {
  TestCamera camera(poses_, "left");
  camera.add_info(info_message(10));
  camera.add_color(color_message(9.9, "rgb8", {1, 2, 3}));
  camera.add(image_of("left", 10), std::chrono::hours(1));
  EXPECT_EQ(camera.ready, 0) << "colour was received lately, but not up to this stamp";
  camera.add_color(color_message(10.01, "rgb8", {1, 2, 3}));
  camera.input.look_through();
  ASSERT_EQ(camera.ready, 1);
  EXPECT_EQ(camera.input.take()->color.header().stamp, ros::Time(10.01));
}

TEST_F(CameraInputs, DropWhatWaitsWhenTheyArePausedOrReset) {
  TestCamera camera(poses_, "left");
  camera.add_info(info_message(10));
  camera.add(image_of("left", 10));
  camera.add(image_of("nowhere", 11));
  camera.input.pause(true);
  ASSERT_EQ(camera.dropped.size(), 2U);
  camera.add(image_of("left", 12));
  ASSERT_EQ(camera.dropped.size(), 3U);
  for (const DroppedImage& image : camera.dropped) EXPECT_EQ(image.result, FrameReport::DROPPED_PAUSED);
  camera.dropped.clear();

  camera.input.pause(false);
  camera.add(image_of("left", 9.5));
  ASSERT_EQ(camera.dropped.size(), 1U) << "a pause changes nothing about the order of stamps";
  EXPECT_EQ(camera.dropped[0].result, FrameReport::DROPPED_OUT_OF_ORDER);
  camera.dropped.clear();

  camera.add(image_of("left", 13));
  camera.add(image_of("nowhere", 14));
  camera.input.reset();
  EXPECT_EQ(camera.dropped.size(), 2U);
  camera.dropped.clear();
  camera.add(image_of("left", 9));
  EXPECT_TRUE(camera.dropped.empty()) << "after a reset any stamp may come";
  EXPECT_EQ(camera.input.next_stamp(), ros::Time(9));
}

TEST_F(CameraInputs, DropWhatWaitsWhenTimeJumpsBack) {
  TestCamera camera(poses_, "left");
  camera.add_info(info_message(10));
  camera.add(image_of("left", 10));
  ASSERT_TRUE(camera.input.take());
  camera.add(image_of("nowhere", 11));
  camera.add(image_of("left", 5));
  ASSERT_EQ(camera.dropped.size(), 1U);
  EXPECT_EQ(camera.dropped[0].arrival.image.header().stamp, ros::Time(11));
  EXPECT_EQ(camera.dropped[0].result, FrameReport::DROPPED_OUT_OF_ORDER);
  EXPECT_EQ(camera.input.next_stamp(), ros::Time(5));
  camera.add(image_of("left", 5.1));
  EXPECT_EQ(camera.dropped.size(), 1U);
}

}  // namespace
}  // namespace frontier_surfels
