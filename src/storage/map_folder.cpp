#include "storage/map_folder.hpp"

#include <algorithm>
#include <exception>
#include <iterator>
#include <utility>

#include "frontier_surfels/types.hpp"
#include "storage/stored_block.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kMostQueued = std::size_t{64} << 20;  // [byte]

std::size_t bytes_in_memory(const std::vector<StoredBlock>& blocks) {
  std::size_t sum = blocks.size() * sizeof(StoredBlock);
  for (const auto& block : blocks) sum += block.second.size();
  return sum;
}

}  // namespace

MapFolder::MapFolder(const std::string& folder, double block_size) : database_(folder, block_size) {
  database_.for_each_block([this](BlockKey key, std::size_t bytes, std::size_t surfels) {
    sizes_[key] = {bytes, surfels};
    bytes_ += bytes;
  });
  thread_ = std::thread(&MapFolder::write_queued, this);
}

MapFolder::~MapFolder() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
    failure_.clear();  // one last try
  }
  changed_.notify_all();
  thread_.join();
}

bool MapFolder::contains(BlockKey key) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return sizes_.count(key) > 0;
}

std::size_t MapFolder::size() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return sizes_.size();
}

std::vector<BlockKey> MapFolder::keys() const {
  std::vector<BlockKey> keys;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    keys.reserve(sizes_.size());
    for (const auto& [key, size] : sizes_) keys.push_back(key);
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

std::uint64_t MapFolder::bytes() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return bytes_;
}

std::size_t MapFolder::surfels(BlockKey key) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto size = sizes_.find(key);
  return size == sizes_.end() ? 0 : size->second.surfels;
}

void MapFolder::write(std::vector<StoredBlock>&& blocks) {
  const std::size_t bytes = bytes_in_memory(blocks);
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [&] { return !failure_.empty() || queue_.empty() || queued_bytes_ + bytes <= kMostQueued; });
  throw_failure();
  if (!blocks.empty()) enqueue({std::move(blocks), false, bytes});
}

std::vector<std::uint8_t> MapFolder::read(BlockKey key) const {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (sizes_.count(key) == 0) return {};
    if (const auto queued = queued_.find(key); queued != queued_.end()) return *queued->second;
  }
  return database_.read(key);
}

void MapFolder::flush() {
  std::unique_lock<std::mutex> lock(mutex_);
  failure_.clear();                             // what matters is whether it can be written now
  if (queue_.empty()) enqueue({{}, false, 0});  // and whether the folder is still there
  changed_.notify_all();
  changed_.wait(lock, [&] { return !failure_.empty() || queue_.empty(); });
  throw_failure();
}

std::string MapFolder::fault() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return fault_;
}

void MapFolder::clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  queue_.erase(std::next(queue_.begin(), writing_ ? 1 : 0), queue_.end());
  queued_bytes_ = writing_ ? queue_.front().bytes : 0;
  if (writing_) queue_.front().obsolete = true;
  queued_.clear();
  sizes_.clear();
  bytes_ = 0;
  failure_.clear();
  fault_.clear();
  enqueue({{}, true, 0});
}

void MapFolder::enqueue(Batch&& batch) {
  queue_.push_back(std::move(batch));
  queued_bytes_ += queue_.back().bytes;
  for (const StoredBlock& block : queue_.back().blocks) index(block);
  changed_.notify_all();
}

void MapFolder::index(const StoredBlock& block) {
  const auto& [key, bytes] = block;
  if (const auto old = sizes_.find(key); old != sizes_.end()) bytes_ -= old->second.bytes;
  bytes_ += bytes.size();
  if (bytes.empty()) {
    sizes_.erase(key);
  } else {
    sizes_[key] = {bytes.size(), surfels_of(bytes.data(), bytes.size())};
  }
  queued_[key] = &bytes;
}

/// Tells of a failure once, and has the thread try again.
void MapFolder::throw_failure() {
  if (failure_.empty()) return;
  const std::string failure = std::exchange(failure_, std::string());
  changed_.notify_all();
  throw FileError(failure);
}

void MapFolder::write_queued() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stopping_ || (!queue_.empty() && failure_.empty()); });
    if (queue_.empty() || !failure_.empty()) return;
    const Batch& batch = queue_.front();
    std::string failure;
    writing_ = true;
    lock.unlock();
    try {
      database_.write(batch.blocks, batch.clear);
    } catch (const std::exception& error) {
      failure = error.what();
    }
    lock.lock();
    writing_ = false;
    if (batch.obsolete) failure.clear();
    failure_ = fault_ = failure;
    if (failure.empty()) written();
    changed_.notify_all();
  }
}

/// Forgets the first of the queue.
void MapFolder::written() {
  const Batch& batch = queue_.front();
  for (const StoredBlock& block : batch.blocks) {
    const auto newest = queued_.find(block.first);
    if (newest != queued_.end() && newest->second == &block.second) queued_.erase(newest);
  }
  queued_bytes_ -= batch.bytes;
  queue_.pop_front();
}

}  // namespace frontier_surfels
