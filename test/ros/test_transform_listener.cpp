/// Transforms that tf cannot use, and what is said about them.
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "ros/bag_input.hpp"
#include "ros/input/conversions.hpp"
#include "ros/input/transform_listener.hpp"

namespace frontier_surfels {
namespace {

using geometry_msgs::TransformStamped;

TransformStamped good() { return replay::tf_message(1, "map", "camera", 1).transforms[0]; }

/// What is said about a good transform after a change.
std::string fault_after(const std::function<void(TransformStamped&)>& spoil, bool is_static = false) {
  TransformStamped transform = good();
  spoil(transform);
  return fault_of(transform, is_static);
}

TEST(FaultOfTransform, NoneIfTfCanUseIt) {
  EXPECT_EQ(fault_of(good(), false), "");
  EXPECT_EQ(fault_after([](auto& t) { t.header.stamp = ros::Time(messages::kLatestTime, 0); }), "");
  EXPECT_EQ(fault_after([](auto& t) { t.header.stamp = ros::TIME_MAX; }, true), "") << "the stamps of static transforms are not used";
}

TEST(FaultOfTransform, NamesWhatIsWrong) {
  const auto check = [](const char* part, const std::function<void(TransformStamped&)>& spoil) {
    EXPECT_NE(fault_after(spoil).find(part), std::string::npos) << fault_after(spoil);
  };
  check("child_frame_id is empty", [](auto& t) { t.child_frame_id = "/"; });
  check("its frame_id is empty", [](auto& t) { t.header.frame_id.clear(); });
  check("same", [](auto& t) { t.child_frame_id = "/map"; });
  check("stamp of 4294967295 s is later than in 2038", [](auto& t) { t.header.stamp = ros::TIME_MAX; });
  check("stamp of 4000000000 s is later than in 2038", [](auto& t) { t.header.stamp = ros::Time(4000000000U, 0); });
  check("not finite", [](auto& t) { t.transform.translation.y = std::numeric_limits<double>::infinity(); });
  check("not finite", [](auto& t) { t.transform.rotation.z = std::numeric_limits<double>::quiet_NaN(); });
  check("quaternion", [](auto& t) { t.transform.rotation = {}; });
}

/// tf itself throws an exception for a stamp that this accepts no longer.
TEST(FaultOfTransform, TfTakesAllThatHaveNone) {
  tf2::BufferCore buffer;
  for (const std::uint32_t second : {1U, 2147483647U, 4000000000U, 4294960000U, 4294967295U}) {
    TransformStamped transform = good();
    transform.header.stamp = ros::Time(second, 0);
    if (!fault_of(transform, false).empty()) continue;
    EXPECT_TRUE(buffer.setTransform(transform, "test")) << second;
    EXPECT_NO_THROW(buffer.setTransform(good(), "test")) << second;
  }
}

}  // namespace
}  // namespace frontier_surfels
