/// A loop on several threads, watched from the calling one.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::scoring {

/// Calls body(0) ... body(count - 1), each once, in any order, on `threads` threads (0: as many as the machine has).
/// `progress`, if any, is called with the share done, on the calling thread only. The first exception of a body is thrown again here.
/// @throws Error if progress returns false
inline void parallel_for(std::size_t count, int threads, const std::function<void(std::size_t)>& body,
                         const std::function<bool(double)>& progress = {}) {
  if (threads <= 0) threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::condition_variable worker_ended;
  std::exception_ptr failure;
  int running = 0;

  const auto work = [&] {
    std::exception_ptr caught;
    try {
      for (std::size_t i = next++; i < count; i = next++) body(i);
    } catch (...) {
      caught = std::current_exception();
      next = count;
    }
    const std::lock_guard<std::mutex> lock(mutex);
    if (caught && !failure) failure = caught;
    --running;
    worker_ended.notify_one();
  };

  std::vector<std::thread> pool;
  std::unique_lock<std::mutex> lock(mutex);
  try {
    for (int i = 0; i < threads; ++i) {
      ++running;
      pool.emplace_back(work);
    }
    while (running > 0) {
      worker_ended.wait_for(lock, std::chrono::milliseconds(100));
      lock.unlock();
      const double share = static_cast<double>(std::min(next.load(), count)) / std::max<std::size_t>(count, 1);
      if (progress && !progress(share)) throw Error("The scoring was stopped before it was done; start it again for a result.");
      lock.lock();
    }
  } catch (...) {
    if (!lock.owns_lock()) lock.lock();
    if (!failure) failure = std::current_exception();
    next = count;
  }
  lock.unlock();
  for (std::thread& thread : pool) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace frontier_surfels::scoring
