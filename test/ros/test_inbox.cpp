/// Depth images that wait for what belongs to them and for the mapper, without a clock: times are given.
#include <frontier_surfels/FrameReport.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "ros/input/inbox.hpp"

namespace frontier_surfels {
namespace {

using std::chrono::milliseconds;
using Stamps = std::vector<double>;

constexpr auto kTimeout = milliseconds(200);
constexpr auto kPeriod = milliseconds(33);
const Clock::time_point kStart = Clock::now();

double stamp_of(const DepthArrival& arrival) { return arrival.image.header().stamp.toSec(); }

/// Images are complete from the moment on at which their stamp is in `known`, or below `known_until`.
class InboxTest : public testing::Test {
 protected:
  void add(double stamp, Clock::duration time) {
    const auto image = boost::make_shared<sensor_msgs::Image>();
    image->header.stamp = ros::Time(stamp);
    inbox_.add({{image, nullptr}, kStart + time});
  }

  void look_through(Clock::duration time) {
    const auto complete = [this](const DepthArrival& arrival, bool last_chance) -> std::optional<CompleteImage> {
      if (stamp_of(arrival) > known_until_ && known_.count(stamp_of(arrival)) == 0) {
        if (last_chance) throw DroppedFrame(FrameReport::DROPPED_NO_POSE, "nothing is known");
        return std::nullopt;
      }
      CompleteImage image;
      image.arrival = arrival;
      return image;
    };
    for (const DroppedImage& image : inbox_.look_through(complete, kStart + time)) note(image);
  }

  void note(const DroppedImage& image) { dropped_[image.result].push_back(stamp_of(image.arrival)); }

  Stamps take_all() {
    Stamps stamps;
    while (inbox_.is_ready()) {
      const double stamp = inbox_.next_stamp().toSec();
      stamps.push_back(stamp_of(inbox_.take().arrival));
      EXPECT_EQ(stamps.back(), stamp);
    }
    return stamps;
  }

  Inbox inbox_{kTimeout};
  double known_until_ = 0;
  std::set<double> known_;
  std::map<int, Stamps> dropped_;  ///< stamps of dropped images by their result
};

TEST_F(InboxTest, ImagesThatAreCompleteDoNotWait) {
  known_until_ = 10;
  add(1, milliseconds(0));
  EXPECT_TRUE(inbox_.is_waiting());
  look_through(milliseconds(0));
  EXPECT_FALSE(inbox_.is_waiting());
  EXPECT_EQ(take_all(), (Stamps{1}));
  EXPECT_TRUE(dropped_.empty());
  EXPECT_EQ(inbox_.completed(), 1U);
}

TEST_F(InboxTest, NoImageIsLostThoughAllPosesAreLate) {
  Stamps mapped;
  for (int n = 1; n <= 100; ++n) {
    add(n, n * kPeriod);
    known_until_ = n - 3;
    look_through(n * kPeriod);
    for (const double stamp : take_all()) mapped.push_back(stamp);
  }
  ASSERT_EQ(mapped.size(), 97U);
  EXPECT_EQ(mapped.back(), 97);
  EXPECT_TRUE(std::is_sorted(mapped.begin(), mapped.end()));
  EXPECT_TRUE(dropped_.empty());
}

TEST_F(InboxTest, ImagesThatBecomeReadyTogetherAreAllKept) {
  for (int n = 1; n <= 5; ++n) add(n, n * kPeriod);
  known_until_ = 2;
  look_through(milliseconds(180));
  known_until_ = 5;
  look_through(milliseconds(185));  // the same transform, received a little later
  EXPECT_EQ(take_all(), (Stamps{1, 2, 3, 4, 5}));
  EXPECT_TRUE(dropped_.empty());
}

TEST_F(InboxTest, OnlyTheNewestWaitsForAMapperThatIsTooSlow) {
  known_until_ = 100;
  for (int n = 1; n <= 4; ++n) {
    add(n, n * kPeriod);
    look_through(n * kPeriod);
  }
  EXPECT_EQ(dropped_[FrameReport::DROPPED_QUEUE], (Stamps{1, 2, 3}));
  add(5, milliseconds(300));
  add(6, milliseconds(300));
  look_through(milliseconds(300));
  EXPECT_EQ(dropped_[FrameReport::DROPPED_QUEUE], (Stamps{1, 2, 3, 4, 5})) << "of several, the newest";
  EXPECT_EQ(take_all(), (Stamps{6}));
}

TEST_F(InboxTest, ImagesAreDroppedAfterTheTimeout) {
  add(1, milliseconds(0));
  add(2, milliseconds(50));
  look_through(kTimeout - milliseconds(1));
  EXPECT_TRUE(dropped_.empty());
  look_through(kTimeout);
  EXPECT_EQ(dropped_[FrameReport::DROPPED_NO_POSE], (Stamps{1}));
  look_through(kTimeout + milliseconds(50));
  EXPECT_EQ(dropped_[FrameReport::DROPPED_NO_POSE], (Stamps{1, 2}));
  EXPECT_FALSE(inbox_.is_waiting());
}

TEST_F(InboxTest, NoMoreImagesWaitThanACameraSendsInTheTimeout) {
  for (int n = 1; n <= 1000; ++n) {
    add(n, milliseconds(0));
    look_through(milliseconds(0));
  }
  const Stamps& dropped = dropped_[FrameReport::DROPPED_NO_POSE];
  EXPECT_GT(dropped.size(), 900U);
  EXPECT_LT(dropped.size(), 990U) << "ten would be a camera of 50 Hz";
  EXPECT_TRUE(std::is_sorted(dropped.begin(), dropped.end())) << "the oldest go first";
  EXPECT_EQ(dropped.front(), 1);
}

TEST_F(InboxTest, AnImageWithoutPoseHoldsUpNoOthers) {
  for (int n = 1; n <= 4; ++n) add(n, n * kPeriod);
  known_ = {2, 4};
  look_through(4 * kPeriod);
  EXPECT_EQ(take_all(), (Stamps{2, 4}));
  known_.insert(1);
  look_through(5 * kPeriod);
  EXPECT_EQ(dropped_[FrameReport::DROPPED_OUT_OF_ORDER], (Stamps{1})) << "images are never mapped out of order";
  look_through(milliseconds(1000));
  EXPECT_EQ(dropped_[FrameReport::DROPPED_NO_POSE], (Stamps{3}));
}

TEST_F(InboxTest, LeaveInTheOrderOfTheirStamps) {
  std::mt19937 random(1);
  for (int run = 0; run < 100; ++run) {
    Stamps stamps{1, 2, 3, 4, 5, 6, 7, 8, 9};
    std::shuffle(stamps.begin(), stamps.end(), random);
    for (const double stamp : stamps) add(100 * run + stamp, milliseconds(1000 * run));
    known_until_ = 100 * run + 9;
    look_through(milliseconds(1000 * run + 1));
    const Stamps taken = take_all();
    EXPECT_EQ(taken.size(), 9U);
    EXPECT_TRUE(std::is_sorted(taken.begin(), taken.end()));
  }
}

/// A pose may arrive while the inbox is being looked through: no image may be overtaken because of that.
TEST_F(InboxTest, WhatArrivesMeanwhileCompletesOlderImagesFirst) {
  for (const int arrives_after : {0, 1, 2, 3}) {
    Inbox inbox(kTimeout);
    for (int n = 1; n <= 3; ++n) {
      const auto image = boost::make_shared<sensor_msgs::Image>();
      image->header.stamp = ros::Time(n);
      inbox.add({{image, nullptr}, kStart});
    }
    int asked = 0;
    const auto complete = [&](const DepthArrival& arrival, bool) -> std::optional<CompleteImage> {
      if (asked++ < arrives_after) return std::nullopt;
      CompleteImage image;
      image.arrival = arrival;
      return image;
    };
    Stamps taken;
    for (int pass = 0; pass < 2; ++pass) {
      EXPECT_TRUE(inbox.look_through(complete, kStart).empty());
      while (inbox.is_ready()) taken.push_back(stamp_of(inbox.take().arrival));
    }
    EXPECT_EQ(taken, (Stamps{1, 2, 3}));
  }
}

TEST_F(InboxTest, EverythingIsDroppedWhenItIsCleared) {
  known_until_ = 1;
  add(1, milliseconds(0));
  add(2, milliseconds(0));
  look_through(milliseconds(0));
  for (const DroppedImage& image : inbox_.clear(FrameReport::DROPPED_PAUSED, "a pause")) note(image);
  EXPECT_EQ(dropped_[FrameReport::DROPPED_PAUSED], (Stamps{1, 2}));
  EXPECT_FALSE(inbox_.is_ready() || inbox_.is_waiting());
  EXPECT_EQ(inbox_.last_stamp(), ros::Time(1));
  inbox_.forget_stamps();
  known_until_ = 10;
  add(0.5, milliseconds(0));
  look_through(milliseconds(0));
  EXPECT_EQ(take_all(), (Stamps{0.5}));
}

}  // namespace
}  // namespace frontier_surfels
