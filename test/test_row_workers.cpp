#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

#include "frame/row_workers.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kMany = 1 << 20;  // values: worth as many threads as there may be

/// How often each row was worked on.
std::vector<int> visits(RowWorkers& workers, int rows, std::size_t values) {
  std::vector<std::atomic<int>> counts(static_cast<std::size_t>(rows));
  workers.run(rows, values, [&](int first, int last) {
    for (int row = first; row < last; ++row) ++counts[static_cast<std::size_t>(row)];
  });
  return {counts.begin(), counts.end()};
}

TEST(RowWorkers, EachRowIsWorkedOnOnce) {
  for (const int threads : {1, 2, 3, 0, 100}) {
    RowWorkers workers(threads);
    for (int repeat = 0; repeat < 50; ++repeat)
      for (const int rows : {0, 1, 2, 7, 16, 17, 480})
        for (const std::size_t values : {std::size_t{0}, std::size_t{50000}, kMany})
          EXPECT_EQ(visits(workers, rows, values), std::vector<int>(static_cast<std::size_t>(rows), 1)) << threads << ", " << values;
  }
}

TEST(RowWorkers, LittleWorkStaysOnTheCallingThread) {
  RowWorkers workers(0);
  int calls = 0;
  workers.run(480, 1000, [&, caller = std::this_thread::get_id()](int first, int last) {
    EXPECT_EQ(std::this_thread::get_id(), caller);
    EXPECT_EQ(first, 0);
    EXPECT_EQ(last, 480);
    ++calls;
  });
  EXPECT_EQ(calls, 1);
}

TEST(RowWorkers, AnExceptionReachesTheCallerAndTheNextWorkIsDone) {
  for (const int threads : {1, 2, 0}) {
    RowWorkers workers(threads);
    for (const int bad : {0, 200, 479}) {
      const auto fail = [bad](int first, int last) {
        if (first <= bad && bad < last) throw std::runtime_error("bad row");
      };
      EXPECT_THROW(workers.run(480, kMany, fail), std::runtime_error);
      EXPECT_EQ(visits(workers, 480, kMany), std::vector<int>(480, 1));
    }
  }
}

/// Also when their threads have only just begun.
TEST(RowWorkers, EndAtOnce) {
  for (int repeat = 0; repeat < 100; ++repeat) {
    RowWorkers workers(0);
    if (repeat % 2 == 0) visits(workers, 100, kMany);
  }
}

}  // namespace
}  // namespace frontier_surfels
