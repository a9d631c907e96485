/// Kernel launches with the device time of each stage, and device buffers that grow.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "opencl/device.hpp"
#include "opencl/fault_injection.hpp"
#include "opencl/programs.hpp"
#include "opencl/work_shape.hpp"

namespace frontier_surfels {

/// Options with which the kernels are built for a device.
std::string build_options(const Device& device);

/// Builds kernels when they are needed, launches them by name and records their times.
class Commands {
 public:
  explicit Commands(Device device);
  ~Commands();
  Commands(const Commands&) = delete;
  Commands& operator=(const Commands&) = delete;

  const Device& device() const { return device_; }
  const WorkShape& shape() const { return shape_; }
  std::size_t lanes() const { return static_cast<std::size_t>(device_.lanes); }            ///< entries that one work item handles: LANES
  std::size_t chunks(std::size_t count) const { return (count + lanes() - 1) / lanes(); }  ///< work items for `count` entries

  /// Builds a program, by its name, now rather than when one of its kernels is first launched. @throws DeviceError  it does not build
  void build(const std::string& program);
  bool has_built(const std::string& program) const { return programs_.count(program) > 0; }

  /// The queue, for one command.
  cl::CommandQueue& queue(Call kind = Call::kLaunch) {
    FaultInjection::step(kind, "clEnqueue");
    pending_ = true;
    return queue_now();
  }

  /// Launches a kernel with at least `items` work items in groups of `group`. Its device time counts towards `stage`.
  template <typename... Args>
  void run(const char* stage, const char* kernel, std::size_t items, std::size_t group, const Args&... args) {
    if (items == 0) return;
    run(stage, kernel, cl::NDRange((items + group - 1) / group * group), cl::NDRange(group), args...);
  }

  template <typename... Args>
  void run(const char* stage, const char* kernel, const cl::NDRange& global, const cl::NDRange& local, const Args&... args) {
    cl::Kernel& called = this->kernel(kernel);
    cl_uint number = 0;
    (called.setArg(number++, args), ...);
    timed(stage, [&](cl::Event* event) { queue().enqueueNDRangeKernel(called, cl::NullRange, global, local, nullptr, event); });
  }

  /// Calls enqueue(event) for one command, with a null event unless its time is to count towards `stage`.
  template <typename Enqueue>
  void timed(const char* stage, Enqueue enqueue) {
    if (!times_stages_) return enqueue(nullptr);
    cl::Event event;
    enqueue(&event);
    events_.emplace_back(stage, std::move(event));
  }

  /// Shall the commands from now on be timed? On a graphics processor all of them take twice as long then. Waits for the device when this
  /// changes.
  void time_stages(bool timed);

  /// Called after a read that has waited for the device: commands run in their order, so all others have ended as well.
  void waited() {
    pending_ = false;
    kept_.clear();
  }

  /// Lets the device begin at once, where a driver would collect commands until the host waits.
  void start() { queue_now().flush(); }

  /// Waits for all commands, if some may still run, and releases the values kept for them.
  void wait();

  /// The same.
  /// @return device time of each stage since the last call, in the order of their first launch; empty where they were not timed
  std::vector<StageTime> take_times();

  /// Drops the times, without waiting.
  void forget_times() { events_.clear(); }

  /// Puts a read off to the next command that waits. Drivers of graphics processors may let the host wait for each read, also for one that
  /// does not block: into memory that is not pinned CUDA copies at once, after all that was launched before. @param read  enqueues it
  void read_later(std::function<void()> read) {
    pending_ = true;
    reads_.push_back(std::move(read));
  }

  /// Enqueues what was put off: to be called before each command that waits. If one fails, the others are dropped.
  void enqueue_reads() {
    for (const auto& read : std::exchange(reads_, {})) read();
  }

  /// Keeps values that a command reads or writes alive until the host has waited for it.
  void keep(std::shared_ptr<const void> values) { kept_.push_back(std::move(values)); }

  std::size_t max_buffer_bytes() const { return max_buffer_bytes_; }  ///< limit of the device for one buffer
  cl::Buffer allocate(std::size_t bytes);                             ///< the caller counts it

  /// Count memory that the caller has allocated or released.
  void allocated(std::size_t bytes) { allocated_bytes_ += bytes; }
  void release(std::size_t bytes) { allocated_bytes_ -= bytes; }
  std::size_t allocated_bytes() const { return allocated_bytes_; }
  std::string memory_text() const;  ///< what is allocated and what the device has, as a clause for people

 private:
  void build(const KernelProgram& program);
  cl::Kernel& kernel(const std::string& name);
  void claim(const cl::Buffer& buffer);
  cl::CommandQueue& queue_now() { return times_stages_ ? timed_queue_ : plain_queue_; }

  Device device_;
  WorkShape shape_;
  cl::CommandQueue timed_queue_, plain_queue_;  ///< one of them has commands at a time
  std::map<std::string, cl::Kernel> kernels_;
  std::set<std::string> programs_;  ///< that were built
  std::vector<std::pair<std::string, cl::Event>> events_;
  std::vector<std::shared_ptr<const void>> kept_;
  std::vector<std::function<void()>> reads_;
  std::size_t allocated_bytes_ = 0, max_buffer_bytes_ = 0, device_bytes_ = 0;
  bool pending_ = false;       ///< commands may still run
  bool times_stages_ = false;  ///< launches have events; outside of a mapper's frames only on a CPU, where it costs nothing
};

/// A device buffer of T that grows and never shrinks.
template <typename T>
class DeviceArray {
 public:
  explicit DeviceArray(Commands& commands) : commands_(&commands) {}
  ~DeviceArray() { commands_->release(capacity_ * sizeof(T)); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;

  /// Makes room for `size` elements and some more. The contents are lost if the buffer grows.
  void resize(std::size_t size) { grow(size, 0); }

  /// As resize(), without more room than needed: for sizes that do not change.
  void allocate(std::size_t size) { grow(size, 0, size + 1); }

  /// Makes room for `size` elements and size / spare more. Keeps the first `kept` elements.
  void grow(std::size_t size, std::size_t kept, std::size_t spare = 4) {
    if (size <= capacity_) return;
    const std::size_t larger = with_spare(size, spare);
    replace(enlarged(larger, kept), larger);
  }

  /// As grow(), and fills a larger buffer with `value` behind the first `kept` elements.
  void grow_filled(const char* stage, T value, std::size_t size, std::size_t kept, std::size_t spare) {
    if (size <= capacity_) return;
    const std::size_t larger = with_spare(size, spare);
    const cl::Buffer bigger = enlarged(larger, kept);
    fill(stage, bigger, value, larger - kept, kept);
    replace(bigger, larger);  // now nothing can fail any more
  }

  /// Replaces rows of `old_width` elements by `rows` rows of `width` elements. The first `kept` rows keep their contents.
  void widen_rows(std::size_t rows, std::size_t kept, std::size_t old_width, std::size_t width) {
    const cl::Buffer bigger = commands_->allocate(rows * width * sizeof(T));
    if (kept > 0 && old_width > 0)
      commands_->queue(Call::kCopy)
          .enqueueCopyBufferRect(buffer_, bigger, {0, 0, 0}, {0, 0, 0}, {old_width * sizeof(T), kept, 1}, old_width * sizeof(T), 0,
                                 width * sizeof(T), 0);
    replace(bigger, rows * width);
  }

  /// Writes values from element `offset` on, growing if needed, and waits for all commands. Elements before `offset` stay.
  void write(const std::vector<T>& values, std::size_t offset = 0) {
    if (values.empty()) return;
    commands_->enqueue_reads();
    grow(offset + values.size(), offset);
    commands_->queue(Call::kUpload).enqueueWriteBuffer(buffer_, CL_TRUE, offset * sizeof(T), values.size() * sizeof(T), values.data());
    commands_->wait();  // drivers may return from a blocking write while earlier commands have not begun
  }

  /// As write(), but does not wait for the device.
  void send(std::vector<T> values, std::size_t offset = 0) { send(std::make_shared<const std::vector<T>>(std::move(values)), offset); }

  /// The same for values that others read, too.
  void send(const std::shared_ptr<const std::vector<T>>& values, std::size_t offset = 0) {
    if (values->empty()) return;
    grow(offset + values->size(), offset);
    commands_->keep(values);
    commands_->queue(Call::kUpload).enqueueWriteBuffer(buffer_, CL_FALSE, offset * sizeof(T), values->size() * sizeof(T), values->data());
  }

  /// Copies the first `size` elements of another array to element `offset` and those behind it, for which there must be room.
  void copy_from(const cl::Buffer& other, std::size_t size, std::size_t offset) {
    if (size == 0) return;
    commands_->queue(Call::kCopy).enqueueCopyBuffer(other, buffer_, 0, offset * sizeof(T), size * sizeof(T));
  }

  std::vector<T> read(std::size_t size, std::size_t offset = 0) const {
    std::vector<T> values(size);
    if (size == 0) return values;
    commands_->enqueue_reads();
    FaultInjection::waits();
    commands_->queue(Call::kRead).enqueueReadBuffer(buffer_, CL_TRUE, offset * sizeof(T), size * sizeof(T), values.data());
    commands_->waited();
    return values;
  }

  /// As read(), but does not wait: the values are there after the next command that does, as they are then.
  std::shared_ptr<const std::vector<T>> read_later(std::size_t size) const {
    const auto values = std::make_shared<std::vector<T>>(size);
    if (size > 0)
      commands_->read_later([commands = commands_, buffer = buffer_, values] {
        commands->keep(values);
        commands->queue(Call::kRead).enqueueReadBuffer(buffer, CL_FALSE, 0, values->size() * sizeof(T), values->data());
      });
    return values;
  }

  T read_one(std::size_t index) const { return read(1, index).front(); }

  void fill(const char* stage, T value, std::size_t size, std::size_t offset = 0) { fill(stage, buffer_, value, size, offset); }

  const cl::Buffer& operator()() const { return buffer_; }
  std::size_t size() const { return capacity_; }
  std::size_t bytes() const { return capacity_ * sizeof(T); }

 private:
  std::size_t with_spare(std::size_t size, std::size_t spare) const {
    return std::max(size, std::min(size + size / spare, commands_->max_buffer_bytes() / sizeof(T)));
  }

  cl::Buffer enlarged(std::size_t size, std::size_t kept) const {
    const cl::Buffer bigger = commands_->allocate(size * sizeof(T));
    if (kept > 0) commands_->queue(Call::kCopy).enqueueCopyBuffer(buffer_, bigger, 0, 0, kept * sizeof(T));
    return bigger;
  }

  void replace(const cl::Buffer& buffer, std::size_t size) {
    commands_->release(bytes());
    buffer_ = buffer;
    capacity_ = size;
    commands_->allocated(bytes());
  }

  void fill(const char* stage, const cl::Buffer& buffer, T value, std::size_t size, std::size_t offset) {
    commands_->timed(stage, [&](cl::Event* event) {
      commands_->queue(Call::kFill).enqueueFillBuffer(buffer, value, offset * sizeof(T), size * sizeof(T), nullptr, event);
    });
  }

  Commands* commands_;
  cl::Buffer buffer_;
  std::size_t capacity_ = 0;
};

/// Values of T that the host sends in every frame for kernels to read. A device that shares the host's memory reads them in place: a copy
/// command would cost more than the copying.
template <typename T>
class SentArray {
 public:
  explicit SentArray(Commands& commands) : commands_(&commands), array_(commands) {}
  ~SentArray() { commands_->release(shared_bytes_); }
  SentArray(const SentArray&) = delete;
  SentArray& operator=(const SentArray&) = delete;

  void send(std::vector<T> values) { send(std::make_shared<const std::vector<T>>(std::move(values))); }

  /// The same for values that others read, too.
  void send(const std::shared_ptr<const std::vector<T>>& values) {
    if (values->empty()) return send(std::vector<T>(1));  // OpenCL has no empty buffers
    if (!commands_->device().shares_memory) return array_.send(values);
    FaultInjection::step(Call::kAllocation, "clCreateBuffer", CL_MEM_OBJECT_ALLOCATION_FAILURE);
    const std::size_t bytes = values->size() * sizeof(T);
    buffer_ = buffer_over(values);
    commands_->keep(values);  // rusticl destroys a buffer before the commands that use it have run
    commands_->release(shared_bytes_);
    shared_bytes_ = bytes;
    commands_->allocated(shared_bytes_);
  }

  const cl::Buffer& operator()() const { return commands_->device().shares_memory ? buffer_ : array_(); }

 private:
  /// The values live as long as the buffer, which commands that use it keep: they may still run when this object goes.
  cl::Buffer buffer_over(const std::shared_ptr<const std::vector<T>>& values) const {
    using Kept = std::shared_ptr<const std::vector<T>>;
    auto kept = std::make_unique<Kept>(values);
    cl::Buffer buffer(commands_->device().context, CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, values->size() * sizeof(T),
                      const_cast<T*>(values->data()));
    buffer.setDestructorCallback([](cl_mem, void* own) { delete static_cast<Kept*>(own); }, kept.get());
    kept.release();
    return buffer;
  }

  Commands* commands_;
  DeviceArray<T> array_;  ///< used on devices with memory of their own
  cl::Buffer buffer_;     ///< used on devices that share the host's memory
  std::size_t shared_bytes_ = 0;
};

}  // namespace frontier_surfels
