#include "frame/row_workers.hpp"

#include <algorithm>
#include <system_error>
#include <utility>

#include "config/threads.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kLeastValues = 20000;  // of a band: they take some tens of microseconds, as it may take a thread to wake
constexpr int kMostThreads = 8;
constexpr int kBandsOfThread = 2;  // a thread that wakes late leaves its second one to others

}  // namespace

RowWorkers::RowWorkers(int threads) : most_threads_(std::min(threads_of_host(threads), kMostThreads)) {}

RowWorkers::~RowWorkers() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  has_work_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void RowWorkers::run(int rows, std::size_t values, const Work& work) {
  const int worth = static_cast<int>(std::min<std::size_t>(values / kLeastValues, kBandsOfThread * kMostThreads));
  const int bands = std::min({rows, worth, kBandsOfThread * most_threads_});
  if (bands < 2 || most_threads_ == 1) return work(0, rows);
  start(std::min(bands, most_threads_) - 1);
  std::unique_lock<std::mutex> lock(mutex_);
  work_ = &work;
  rows_ = rows;
  bands_ = left_ = bands;
  next_ = 0;
  failure_ = nullptr;
  has_work_.notify_all();
  take_bands(lock);
  is_done_.wait(lock, [this] { return left_ == 0; });
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

/// @param threads  beside the calling one; fewer are started if the system has no more
void RowWorkers::start(int threads) {
  try {
    while (static_cast<int>(threads_.size()) < threads) threads_.emplace_back(&RowWorkers::wait_for_work, this);
  } catch (const std::system_error&) {  // those that there are do the work
  }
}

void RowWorkers::wait_for_work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    take_bands(lock);
    has_work_.wait(lock, [this] { return stopping_ || next_ < bands_; });
  }
}

/// @param lock  of the mutex, which is free while a band is worked on
void RowWorkers::take_bands(std::unique_lock<std::mutex>& lock) {
  const auto begin = [this](int band) { return static_cast<int>(static_cast<long>(rows_) * band / bands_); };
  while (next_ < bands_) {
    const int first = begin(next_), last = begin(next_ + 1);
    const Work& work = *work_;
    ++next_;
    lock.unlock();
    std::exception_ptr failure;
    try {
      work(first, last);
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    if (failure) failure_ = failure;
    if (--left_ == 0) is_done_.notify_one();
  }
}

}  // namespace frontier_surfels
