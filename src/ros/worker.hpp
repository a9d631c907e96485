/// The thread that alone touches the mapper: the newest frame, and jobs in between.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <thread>

namespace frontier_surfels {

/// @tparam Frame  only the newest one waits; a frame that is replaced is handed back to whoever brought the newer one
template <typename Frame>
class Worker {
 public:
  /// @param on_frame  maps a frame
  /// @param after     called after every frame, job and wake()
  Worker(std::function<void(const Frame&)> on_frame, std::function<void()> after)
      : on_frame_(std::move(on_frame)), after_(std::move(after)) {}
  ~Worker() { stop(); }

  /// Begins; what has come before waits.
  void start() {
    thread_ = std::thread([this] { run(); });
  }

  /// Ends after the frame or job at hand; jobs that wait are dropped, and their callers told so.
  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
    jobs_.clear();  // breaks the promises of those that wait
  }

  /// Leaves a frame. @return the one that waited and is now dropped
  std::optional<Frame> put(Frame frame) {
    std::optional<Frame> replaced;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      replaced = std::move(waiting_);
      waiting_ = std::move(frame);
    }
    changed_.notify_all();
    return replaced;
  }

  /// Runs a job between frames and waits for it; what it throws is thrown here. @throws std::future_error if the worker has been stopped
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

  /// Has `after` called once, even if no frame comes.
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
      changed_.wait(lock, [this] { return stopping_ || woken_ || waiting_ || !jobs_.empty(); });
      if (stopping_) return;
      woken_ = false;
      if (!jobs_.empty()) {
        const auto job = std::move(jobs_.front());
        jobs_.pop_front();
        lock.unlock();
        job();
      } else if (waiting_) {
        const Frame frame = std::move(*waiting_);
        waiting_.reset();
        lock.unlock();
        on_frame_(frame);
      } else {
        lock.unlock();
      }
      after_();
      lock.lock();
    }
  }

  const std::function<void(const Frame&)> on_frame_;
  const std::function<void()> after_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Frame> waiting_;
  std::deque<std::function<void()>> jobs_;
  bool stopping_ = false, woken_ = false;
  std::thread thread_;
};

}  // namespace frontier_surfels
