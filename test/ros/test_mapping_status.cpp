/// What /diagnostics says after failed, dropped and mapped frames. Times are given.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "ros/output/mapping_status.hpp"

namespace frontier_surfels {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using std::chrono::milliseconds;
using std::chrono::seconds;

FrameReport report(std::uint8_t result, const std::string& reason = "") {
  FrameReport message;
  message.result = result;
  message.reason = reason;
  message.surfels = 10;
  return message;
}

class MappingStatusTest : public testing::Test {
 protected:
  void add(std::uint8_t result, const std::string& reason = "") { status_.add(report(result, reason), now_); }

  /// Maps frames for this time, ten a second.
  void map(seconds time) {
    for (const auto end = now_ + time; now_ < end; now_ += milliseconds(100)) add(FrameReport::INTEGRATED);
  }

  diagnostic_updater::DiagnosticStatusWrapper filled() {
    diagnostic_updater::DiagnosticStatusWrapper status;
    status_.fill(status, now_);
    return status;
  }

  std::string value(const std::string& key) {
    for (const auto& entry : filled().values)
      if (entry.key == key) return entry.value;
    return "none";
  }

  MappingStatus status_{"device", "/depth"};
  MappingStatus::Clock::time_point now_ = MappingStatus::Clock::now();
};

TEST_F(MappingStatusTest, AFailureClearsAfterFramesAreMappedAgain) {
  map(seconds(2));
  EXPECT_EQ(filled().level, DiagnosticStatus::OK);
  add(FrameReport::FAILED, "The device is out of memory.");
  EXPECT_EQ(filled().level, DiagnosticStatus::ERROR);
  map(seconds(2));
  EXPECT_EQ(filled().level, DiagnosticStatus::ERROR) << "whoever looks once a second must see it";
  EXPECT_EQ(filled().message, "The device is out of memory.");
  map(seconds(4));
  EXPECT_EQ(filled().level, DiagnosticStatus::OK);
  EXPECT_EQ(filled().message, "mapping");
  EXPECT_EQ(value("frames failed"), "1");
  EXPECT_EQ(value("last failure"), "The device is out of memory.");
}

TEST_F(MappingStatusTest, AFailureStaysWhileNothingIsMapped) {
  add(FrameReport::FAILED, "The device is lost.");
  now_ += seconds(100);
  EXPECT_EQ(filled().level, DiagnosticStatus::ERROR);
}

TEST_F(MappingStatusTest, ALaterReasonDoesNotReplaceThatOfAFailure) {
  add(FrameReport::FAILED, "The device is lost.");
  add(FrameReport::DROPPED_NO_POSE, "There is no transform.");
  EXPECT_EQ(filled().level, DiagnosticStatus::ERROR);
  EXPECT_EQ(filled().message, "The device is lost.");
  map(seconds(1));
  now_ += seconds(10);
  EXPECT_EQ(filled().level, DiagnosticStatus::WARN);
  EXPECT_EQ(filled().message, "There is no transform.");
}

TEST_F(MappingStatusTest, AFaultOfTheMapFolderClearsWithIt) {
  const std::string fault = "The map folder /map cannot be written.";
  map(seconds(6));
  status_.set_map_folder_fault(fault);
  EXPECT_EQ(filled().level, DiagnosticStatus::ERROR) << "although frames are mapped";
  EXPECT_EQ(filled().message, fault);
  status_.set_paused(true);
  EXPECT_EQ(filled().level, DiagnosticStatus::ERROR);
  status_.set_map_folder_fault("");
  EXPECT_EQ(filled().level, DiagnosticStatus::OK);
}

/// The last frame before the camera stopped failed because of the folder.
TEST_F(MappingStatusTest, AFrameThatFailedForTheMapFolderIsNoErrorForEver) {
  const std::string fault = "The map folder /map cannot be written.";
  map(seconds(1));
  add(FrameReport::FAILED, fault);
  status_.set_map_folder_fault(fault);
  now_ += seconds(100);
  EXPECT_EQ(filled().level, DiagnosticStatus::ERROR);
  status_.set_map_folder_fault("");
  EXPECT_EQ(filled().level, DiagnosticStatus::WARN) << "no image comes";

  add(FrameReport::FAILED, "The device is lost.");
  status_.set_map_folder_fault(fault);
  status_.set_map_folder_fault("");
  now_ += seconds(100);
  EXPECT_EQ(filled().message, "The device is lost.");
}

TEST_F(MappingStatusTest, ALoadedMapIsCountedBeforeTheFirstFrame) {
  Statistics map;
  map.surfels = 1234;
  map.map_bytes = 5000000;
  map.seen_bytes = 300000;
  status_.set_map(map, 1000);
  EXPECT_EQ(value("surfels"), "2234");
  EXPECT_EQ(value("surfels on disk only"), "1000");
  EXPECT_EQ(value("memory of the map [MB]"), "5.0");
  EXPECT_EQ(value("memory of what has been seen [MB]"), "0.3");
  EXPECT_EQ(filled().level, DiagnosticStatus::WARN) << "no image has come";
}

TEST_F(MappingStatusTest, FramesThatAddNothingAreAWarning) {
  map(seconds(1));
  for (int i = 0; i < 40; ++i, now_ += milliseconds(100)) add(FrameReport::INTEGRATED, "The depth image has no measurement.");
  EXPECT_EQ(filled().message, "mapping") << "some of the last frames added something";
  for (int i = 0; i < 20; ++i, now_ += milliseconds(100)) add(FrameReport::INTEGRATED, "The depth image has no measurement.");
  EXPECT_EQ(filled().level, DiagnosticStatus::WARN);
  EXPECT_EQ(filled().message, "The depth image has no measurement.");
  map(seconds(1));
  EXPECT_EQ(filled().level, DiagnosticStatus::OK);
}

}  // namespace
}  // namespace frontier_surfels
