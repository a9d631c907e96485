/// Bags and ROS messages with bytes damaged at random: never a crash, always frames or a sentence.
#include <console_bridge/console.h>
#include <gtest/gtest.h>
#include <ros/serialization.h>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "random_bytes.hpp"
#include "recordings/bag_transforms.hpp"
#include "ros/bag_input.hpp"

namespace frontier_surfels::replay {
namespace {

class DamagedMessages : public BagTest {
 protected:
  void SetUp() override {
    BagTest::SetUp();
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    console_bridge::noOutputHandler();  // tf2 prints a warning for each damaged transform
    limit_memory(true);
  }
  void TearDown() override {
    limit_memory(false);
    console_bridge::restorePreviousOutputHandler();
    BagTest::TearDown();
  }

  /// Damages the bytes of a message in its serialised form, and hands over what ROS makes of them.
  /// @param share  the inputs are divided by this number, for messages that are tested in several variants
  template <typename Message, typename Use>
  static void use_damaged(const Message& message, int usual, int share, Use use) {
    const ros::SerializedMessage serialised = ros::serialization::serializeMessage(message);
    const std::string bytes(reinterpret_cast<const char*>(serialised.message_start), serialised.num_bytes - 4);
    expect_sentences(random_inputs(usual) / share, [&](Damage& damage) {
      std::string damaged = damage(bytes);
      const auto received = boost::make_shared<Message>();
      try {
        ros::serialization::IStream stream(reinterpret_cast<std::uint8_t*>(damaged.data()), static_cast<std::uint32_t>(damaged.size()));
        ros::serialization::deserialize(stream, *received);
      } catch (const std::exception&) {  // ROS refuses such a message before anybody gets it
        throw Error("The message cannot be received.");
      }
      use(received);
    });
  }

  static void use_image(const messages::ImageMessage& message) {
    try {
      messages::copy(messages::color_pixels(message).view);
    } catch (const Error&) {  // as a depth image below
    }
    messages::copy(messages::depth_pixels(message).view);
  }
};

TEST_F(DamagedMessages, RawImages) {
  use_damaged(depth_message(10), 3000, 1, [](const sensor_msgs::ImageConstPtr& image) { use_image({image, nullptr}); });
}

TEST_F(DamagedMessages, ColourImages) {
  for (const char* encoding : {"rgb8", "bayer_rggb8", "yuv422"}) {
    const std::size_t channels = encoding == std::string("rgb8") ? 3 : encoding == std::string("yuv422") ? 2 : 1;
    const sensor_msgs::Image color = color_message(10, encoding, std::vector<std::uint8_t>(channels, 7));
    use_damaged(color, 3000, 3, [](const sensor_msgs::ImageConstPtr& image) {
      messages::copy(messages::color_pixels({image, nullptr}).view);
    });
  }
}

TEST_F(DamagedMessages, CompressedImages) {
  use_damaged(compressed_depth(10, 100, 1), 3000, 1, [](const sensor_msgs::CompressedImageConstPtr& image) {
    use_image({nullptr, image});
  });
}

TEST_F(DamagedMessages, Cameras) {
  use_damaged(info_message(10), 3000, 1, [](const sensor_msgs::CameraInfoConstPtr& info) {
    const Intrinsics camera = messages::to_intrinsics(*info, cv::Size(kWidth, kHeight));
    EXPECT_GT(camera.fx, 0);
    EXPECT_EQ(camera.width, kWidth);
  });
}

TEST_F(DamagedMessages, Transforms) {
  tf2_msgs::TFMessage message = tf_message(10, "world", "camera", 1);
  message.transforms.push_back(tf_message(11, "world", "camera", 2).transforms[0]);
  use_damaged(message, 3000, 1, [](const tf2_msgs::TFMessageConstPtr& received) {
    BagTransforms transforms;
    transforms.add(*received, false);
    const Eigen::Isometry3d pose = transforms.T_world_frame(transforms.root_of("camera"), "camera", ros::Time(10.5));
    EXPECT_TRUE(pose.matrix().allFinite());
  });
}

TEST_F(DamagedMessages, Bags) {
  for (const auto compression : {rosbag::compression::Uncompressed, rosbag::compression::LZ4, rosbag::compression::BZ2}) {
    Handmade(path_, compression)
        .add_camera_and_motion()
        .add("/depth/image", 10, depth_message(10))
        .add("/depth/image", 10.5, depth_message(10.5))
        .add("/rgb/image", 10.5, color_message(10.5, "rgb8", {1, 2, 3}))
        .close();
    const std::string intact = read_bytes(path_);
    expect_sentences(random_inputs(3000) / 3, [&](Damage& damage) {
      write_bytes(path_, damage(intact));
      const auto source = open_source(path_);
      while (const auto frame = source->next()) frame->view();
      if (source->skipped().size() == source->size()) throw BadFrame(source->skipped().front());
    });
  }
}

}  // namespace
}  // namespace frontier_surfels::replay
