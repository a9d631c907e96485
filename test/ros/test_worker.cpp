/// The thread between the callbacks and the mapper.

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>
#include <vector>

#include "ros/worker.hpp"

namespace frontier_surfels {
namespace {

/// Holds a worker's frame back until it is let go.
struct Gate {
  std::promise<void> opened;
  std::shared_future<void> open{opened.get_future()};
};

TEST(Worker, OnlyTheNewestFrameWaits) {
  Gate gate;
  std::promise<void> first_began;
  std::vector<int> mapped;
  Worker<int> worker(
      [&](int frame) {
        if (frame == 1) {
          first_began.set_value();
          gate.open.wait();
        }
        mapped.push_back(frame);
      },
      [] {});
  worker.start();
  EXPECT_FALSE(worker.put(1));
  first_began.get_future().wait();
  EXPECT_FALSE(worker.put(2));
  EXPECT_EQ(worker.put(3), 2);
  EXPECT_EQ(worker.put(4), 3);
  gate.opened.set_value();
  worker.run_job([] {});  // after frame 1; frame 4 may come before or after
  while (worker.run_job([&] { return mapped.size(); }) < 2) std::this_thread::yield();
  worker.stop();
  EXPECT_EQ(mapped, (std::vector<int>{1, 4}));
}

TEST(Worker, JobsAnswerAndThrow) {
  Worker<int> worker([](int) {}, [] {});
  worker.start();
  EXPECT_EQ(worker.run_job([] { return 7; }), 7);
  EXPECT_THROW(worker.run_job([]() -> int { throw std::runtime_error("no"); }), std::runtime_error);
  EXPECT_EQ(worker.run_job([] { return 8; }), 8) << "a job that throws ends nothing";
}

TEST(Worker, WakesWithoutFrames) {
  std::promise<void> called;
  std::atomic<int> calls{0};
  Worker<int> worker([](int) {},
                     [&] {
                       if (++calls == 1) called.set_value();
                     });
  worker.wake();  // before it starts: not lost
  worker.start();
  called.get_future().wait();
  worker.stop();
  EXPECT_GE(calls, 1);
}

TEST(Worker, StopTellsJobsThatWait) {
  Gate gate;
  std::promise<void> began;
  Worker<int> worker(
      [&](int) {
        began.set_value();
        gate.open.wait();
      },
      [] {});
  worker.start();
  worker.put(1);
  began.get_future().wait();
  auto waiting = std::async(std::launch::async, [&] { worker.run_job([] {}); });
  auto stopped = std::async(std::launch::async, [&] { worker.stop(); });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));  // both wait for the frame
  gate.opened.set_value();
  stopped.get();
  EXPECT_THROW(waiting.get(), std::future_error);
  EXPECT_THROW(worker.run_job([] {}), std::future_error);
}

}  // namespace
}  // namespace frontier_surfels
