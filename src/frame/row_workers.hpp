/// Work on the rows of images by several threads.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace frontier_surfels {

/// Threads that wait for rows: to wake one costs the calling thread some microseconds, to start one 25 to 50.
class RowWorkers {
 public:
  using Work = std::function<void(int first, int last)>;

  /// Starts no thread: the first work that is worth it does. @param threads  Config::threads
  explicit RowWorkers(int threads);
  ~RowWorkers();
  RowWorkers(const RowWorkers&) = delete;
  RowWorkers& operator=(const RowWorkers&) = delete;

  /// Calls work(first, last) for bands of rows, first ... last - 1, that make up all rows, on several threads, the calling one among them.
  /// All have ended when it returns. An exception of any of them is thrown again here. Not to be called by two threads at
  /// once, nor by the work.
  /// @param values  numbers that are read for all rows together
  void run(int rows, std::size_t values, const Work& work);

 private:
  void start(int threads);
  void wait_for_work();
  void take_bands(std::unique_lock<std::mutex>& lock);

  const int most_threads_;  ///< the calling one is among them
  std::vector<std::thread> threads_;

  std::mutex mutex_;  ///< of all below
  std::condition_variable has_work_, is_done_;
  bool stopping_ = false;
  const Work* work_ = nullptr;
  int rows_ = 0, bands_ = 0;
  int next_ = 0;  ///< band that nobody has taken yet
  int left_ = 0;  ///< bands that are not done
  std::exception_ptr failure_;
};

}  // namespace frontier_surfels
