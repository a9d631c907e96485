/// The mapping thread, which alone touches the mapper.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

namespace frontier_surfels {

/// Maps one frame after the other, and runs jobs in between.
class Worker {
 public:
  /// @param map_next  maps the next frame; returns false if none is ready
  /// @param after     called after every frame, every job and every wake()
  Worker(std::function<bool()> map_next, std::function<void()> after) : map_next_(std::move(map_next)), after_(std::move(after)) {}
  ~Worker() { stop(); }

  /// Starts the thread. A wake() before this is not lost.
  void start() {
    thread_ = std::thread([this] { run(); });
  }

  /// Stops after the current frame or job. Callers of waiting jobs get std::future_error.
  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
    jobs_.clear();  // breaks the promises of waiting jobs
  }

  /// Runs a job between two frames and waits for it. What the job throws is thrown here.
  /// @throws std::future_error if the worker has been stopped
  template <typename Job>
  auto run_job(Job job) -> decltype(job()) {
    auto task = std::make_shared<std::packaged_task<decltype(job())()>>(std::move(job));
    auto result = task->get_future();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (stopping_) throw std::future_error(std::future_errc::broken_promise);
      jobs_.push_back([task] { (*task)(); });
    }
    task.reset();
    changed_.notify_all();
    return result.get();
  }

  /// Has the thread map the frames that are ready, and call `after` at least once.
  void wake() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      woken_ = true;
    }
    changed_.notify_all();
  }

 private:
  void run() {
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return stopping_ || woken_ || !jobs_.empty(); });
      if (stopping_) return;
      std::function<void()> job;
      if (jobs_.empty()) {
        woken_ = false;
      } else {
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
      lock.unlock();
      bool is_more_ready = false;
      if (job)
        job();
      else
        is_more_ready = map_next_();
      after_();
      lock.lock();
      woken_ = woken_ || is_more_ready;
    }
  }

  const std::function<bool()> map_next_;
  const std::function<void()> after_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  bool stopping_ = false, woken_ = false;
  std::thread thread_;
};

}  // namespace frontier_surfels
