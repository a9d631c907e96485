/// The program, its queue, buffers that grow, and the time that each stage took.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "opencl/device.hpp"

namespace frontier_surfels {

/// Options that the kernels are built with for a device.
std::string build_options(const Device& device);

/// Builds all kernels once; launches them by name and notes their times.
class Commands {
 public:
  explicit Commands(Device device);
  ~Commands();
  Commands(const Commands&) = delete;
  Commands& operator=(const Commands&) = delete;

  const Device& device() const { return device_; }
  std::size_t lanes() const { return static_cast<std::size_t>(device_.lanes); }            ///< that a work item handles
  std::size_t chunks(std::size_t count) const { return (count + lanes() - 1) / lanes(); }  ///< of LANES that `count` entries make
  cl::CommandQueue& queue() { return queue_; }

  /// Launches a kernel over at least `items` work items, in groups of `group`, and counts its time to `stage`.
  template <typename... Args>
  void run(const char* stage, const char* kernel, std::size_t items, std::size_t group, const Args&... args) {
    if (items == 0) return;
    run(stage, kernel, cl::NDRange((items + group - 1) / group * group), cl::NDRange(group), args...);
  }

  template <typename... Args>
  void run(const char* stage, const char* kernel, const cl::NDRange& global, const cl::NDRange& local, const Args&... args) {
    cl::KernelFunctor<Args...> functor(kernels_.at(kernel));
    note(stage, functor(cl::EnqueueArgs(queue_, global, local), args...));
  }

  void note(const char* stage, cl::Event event) { events_.emplace_back(stage, std::move(event)); }

  /// Waits for all launches, and forgets what was kept for them. Device time of each stage since the last call, in the order of their
  /// first launch.
  std::vector<StageTime> take_times();

  /// The same without the times.
  void forget_times();

  /// Keeps what a command reads from until take_times() or forget_times().
  void keep(std::shared_ptr<const void> values) { kept_.push_back(std::move(values)); }

  std::size_t most_bytes() const { return most_bytes_; }  ///< that a buffer may have
  cl::Buffer allocate(std::size_t bytes);
  void allocated(std::size_t bytes) { allocated_bytes_ += bytes; }
  void release(std::size_t bytes) { allocated_bytes_ -= bytes; }
  std::size_t allocated_bytes() const { return allocated_bytes_; }

 private:
  void finish();  ///< waits for all launches, and drops what was kept for them

  Device device_;
  cl::CommandQueue queue_;
  std::map<std::string, cl::Kernel> kernels_;
  std::vector<std::pair<std::string, cl::Event>> events_;
  std::vector<std::shared_ptr<const void>> kept_;
  std::size_t allocated_bytes_ = 0, most_bytes_ = 0;
};

/// A buffer of T that only ever grows.
template <typename T>
class DeviceArray {
 public:
  explicit DeviceArray(Commands& commands) : commands_(&commands) {}
  ~DeviceArray() { commands_->release(capacity_ * sizeof(T)); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;

  /// Makes room for `size` elements, with some to spare; what it held is lost if it grows.
  void resize(std::size_t size) { grow(size, 0); }

  /// The same for a size that stays: nothing to spare.
  void allocate(std::size_t size) { grow(size, 0, size + 1); }

  /// Makes room for `size` elements, with one of `spare` ahead, and keeps the first `kept`.
  void grow(std::size_t size, std::size_t kept, std::size_t spare = 4) {
    if (size <= capacity_) return;
    const std::size_t larger = std::max(size, std::min(size + size / spare, commands_->most_bytes() / sizeof(T)));
    const cl::Buffer bigger = commands_->allocate(larger * sizeof(T));
    if (kept > 0) commands_->queue().enqueueCopyBuffer(buffer_, bigger, 0, 0, kept * sizeof(T));
    commands_->release(capacity_ * sizeof(T));
    buffer_ = bigger;
    capacity_ = larger;
  }

  /// Replaces rows of `old_width` elements by `rows` of `width`, nothing to spare. The first `kept` rows keep what they hold.
  void widen_rows(std::size_t rows, std::size_t kept, std::size_t old_width, std::size_t width) {
    const cl::Buffer bigger = commands_->allocate(rows * width * sizeof(T));
    if (kept > 0 && old_width > 0)
      commands_->queue().enqueueCopyBufferRect(buffer_, bigger, {0, 0, 0}, {0, 0, 0}, {old_width * sizeof(T), kept, 1},
                                               old_width * sizeof(T), 0, width * sizeof(T), 0);
    commands_->release(bytes());
    buffer_ = bigger;
    capacity_ = rows * width;
  }

  void write(const std::vector<T>& values, std::size_t offset = 0) {
    if (values.empty()) return;
    grow(offset + values.size(), offset);
    commands_->queue().enqueueWriteBuffer(buffer_, CL_TRUE, offset * sizeof(T), values.size() * sizeof(T), values.data());
  }

  /// The same without waiting for it, nor for what is running.
  void send(std::vector<T> values, std::size_t offset = 0) {
    if (values.empty()) return;
    grow(offset + values.size(), offset);
    const auto kept = std::make_shared<const std::vector<T>>(std::move(values));
    commands_->keep(kept);
    commands_->queue().enqueueWriteBuffer(buffer_, CL_FALSE, offset * sizeof(T), kept->size() * sizeof(T), kept->data());
  }

  std::vector<T> read(std::size_t size, std::size_t offset = 0) const {
    std::vector<T> values(size);
    if (size > 0) commands_->queue().enqueueReadBuffer(buffer_, CL_TRUE, offset * sizeof(T), size * sizeof(T), values.data());
    return values;
  }

  T read_one(std::size_t index) const { return read(1, index).front(); }

  void fill(const char* stage, T value, std::size_t size, std::size_t offset = 0) {
    cl::Event event;
    commands_->queue().enqueueFillBuffer(buffer_, value, offset * sizeof(T), size * sizeof(T), nullptr, &event);
    commands_->note(stage, event);
  }

  const cl::Buffer& operator()() const { return buffer_; }
  std::size_t size() const { return capacity_; }
  std::size_t bytes() const { return capacity_ * sizeof(T); }

 private:
  Commands* commands_;
  cl::Buffer buffer_;
  std::size_t capacity_ = 0;
};

/// Values of T that the host gives anew with every frame, for kernels to read. A device that shares the host's memory reads them where they
/// are: that saves a command, which costs more than what is copied.
template <typename T>
class SentArray {
 public:
  explicit SentArray(Commands& commands) : commands_(&commands), array_(commands) {}
  ~SentArray() { commands_->release(shared_bytes()); }
  SentArray(const SentArray&) = delete;
  SentArray& operator=(const SentArray&) = delete;

  void send(std::vector<T> values) {
    if (values.empty()) values.resize(1);  // there are no empty buffers
    if (!commands_->device().shares_memory) return array_.send(std::move(values));
    auto shared = std::make_shared<std::vector<T>>(std::move(values));
    commands_->keep(shared);
    commands_->keep(shared_);  // what runs may still read what was sent before
    buffer_ = cl::Buffer(commands_->device().context, CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, shared->size() * sizeof(T), shared->data());
    commands_->release(shared_bytes());
    shared_ = std::move(shared);
    commands_->allocated(shared_bytes());
  }

  const cl::Buffer& operator()() const { return commands_->device().shares_memory ? buffer_ : array_(); }

 private:
  std::size_t shared_bytes() const { return shared_ == nullptr ? 0 : shared_->size() * sizeof(T); }

  Commands* commands_;
  DeviceArray<T> array_;  ///< of a device with a memory of its own
  std::shared_ptr<const std::vector<T>> shared_;
  cl::Buffer buffer_;  ///< of what it shares
};

}  // namespace frontier_surfels
