/// How often warnings are given.
#include <gtest/gtest.h>

#include "ros/input/warning_throttle.hpp"

namespace frontier_surfels {
namespace {

using std::chrono::seconds;

TEST(KindOfWarning, NumbersMakeNoDifference) {
  EXPECT_EQ(kind_of("It is 0.25 s older (640x480, -3 or 2.5e+03, 16UC1): 5."), kind_of("It is 12 s older (320x240, 4 or 7, 32FC1): 61."));
  EXPECT_EQ(kind_of("It is 0.25 s older."), "It is # s older.");
}

TEST(KindOfWarning, NamesDo) {
  EXPECT_EQ(kind_of("The topic /camera_1/depth of 'arm2'."), "The topic /camera_1/depth of 'arm2'.");
  EXPECT_EQ(kind_of("- and + -"), "- and + -");
  EXPECT_EQ(kind_of(""), "");
}

TEST(Warnings, OfOneKindAreCountedWhileTheyAreNotDue) {
  WarningThrottle warnings(seconds(5));
  WarningThrottle::Clock::time_point now;
  EXPECT_EQ(warnings.due("It is 1 s old.", now), 1U);
  now += seconds(4);
  EXPECT_EQ(warnings.due("It is 2 s old.", now), 0U);
  EXPECT_EQ(warnings.due("It is 3 s old.", now), 0U);
  now += seconds(1);
  EXPECT_EQ(warnings.due("It is 4 s old.", now), 3U);
  EXPECT_EQ(warnings.due("It is 5 s old.", now), 0U);
}

TEST(Warnings, OfAnotherKindAreNotHidden) {
  WarningThrottle warnings(seconds(5));
  EXPECT_EQ(warnings.due("It is old.", {}), 1U);
  EXPECT_EQ(warnings.due("It is dark.", {}), 1U);
  EXPECT_EQ(warnings.due("It is old.", {}), 0U);
}

TEST(Warnings, OfAnyTextDoNotFillTheLog) {
  WarningThrottle warnings(seconds(5));
  WarningThrottle::Clock::time_point now;
  std::size_t given = 0;
  for (int n = 0; n < 1000; ++n) given += warnings.due("What is x" + std::to_string(n) + "?", now);
  EXPECT_EQ(given, WarningThrottle::kMostKinds);
  now += seconds(5);
  EXPECT_EQ(warnings.due("What is y?", now), 1U);
}

}  // namespace
}  // namespace frontier_surfels
