/// The mapping thread.

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>
#include <vector>

#include "ros/worker.hpp"

namespace frontier_surfels {
namespace {

/// Holds the worker back until it is opened.
struct Gate {
  std::promise<void> opened;
  std::shared_future<void> open{opened.get_future()};
};

TEST(Worker, MapsAllThatIsReadyWhenItIsWoken) {
  std::atomic<int> ready{3}, mapped{0}, after{0};
  std::promise<void> done;
  Worker worker(
      [&] {
        if (ready == 0) return false;
        --ready;
        ++mapped;
        return true;
      },
      [&] {
        ++after;
        if (ready == 0 && mapped == 3) {
          mapped = 0;
          done.set_value();
        }
      });
  worker.start();
  worker.wake();
  done.get_future().wait();
  EXPECT_GE(after, 3) << "`after` is called after every frame";
}

TEST(Worker, RunsJobsBetweenFrames) {
  Gate gate;
  std::promise<void> first_began;
  std::vector<int> order;
  int frame = 0;
  Worker worker(
      [&] {
        if (frame == 2) return false;
        if (++frame == 1) {
          first_began.set_value();
          gate.open.wait();
        }
        order.push_back(frame);
        return true;
      },
      [] {});
  worker.wake();  // is not lost although the worker has not started
  worker.start();
  first_began.get_future().wait();
  auto job = std::async(std::launch::async, [&] { worker.run_job([&] { order.push_back(-1); }); });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));  // the job waits for the frame
  gate.opened.set_value();
  job.get();
  while (worker.run_job([&] { return order.size(); }) < 3) std::this_thread::yield();
  worker.stop();
  EXPECT_EQ(order, (std::vector<int>{1, -1, 2}));
}

TEST(Worker, JobsAnswerAndThrow) {
  Worker worker([] { return false; }, [] {});
  worker.start();
  EXPECT_EQ(worker.run_job([] { return 7; }), 7);
  EXPECT_THROW(worker.run_job([]() -> int { throw std::runtime_error("no"); }), std::runtime_error);
  EXPECT_EQ(worker.run_job([] { return 8; }), 8) << "the worker continues after a job that throws";
}

TEST(Worker, CallsAfterWithoutFrames) {
  std::promise<void> called;
  std::atomic<int> calls{0};
  Worker worker([] { return false; },
                [&] {
                  if (++calls == 1) called.set_value();
                });
  worker.wake();
  worker.start();
  called.get_future().wait();
  worker.stop();
  EXPECT_GE(calls, 1);
}

TEST(Worker, StopTellsJobsThatWait) {
  Gate gate;
  std::promise<void> began;
  Worker worker(
      [&] {
        began.set_value();
        gate.open.wait();
        return false;
      },
      [] {});
  worker.start();
  worker.wake();
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
