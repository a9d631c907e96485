/// Blocks of the map on disk, for those that memory has no room for. Killed at any moment, a map folder opens again: with some number
/// of the first transactions, each whole.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <list>
#include <mutex>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "map/block_key.hpp"
#include "storage/map_database.hpp"

namespace frontier_surfels {

/// One thread may change it. Others may call the const members meanwhile, and read blocks that it does not erase.
class MapFolder {
 public:
  /// Opens `folder`, made if missing, with the database map.sqlite in it.
  /// @throws FileError  it cannot be made, read or written; is in use by another mapper; its file is damaged, another program's or a
  ///                    newer version's; was made with another block_size [m]
  MapFolder(const std::string& folder, double block_size);

  /// Waits until all is written. What cannot be written is lost: flush() before tells.
  ~MapFolder();
  MapFolder(const MapFolder&) = delete;
  MapFolder& operator=(const MapFolder&) = delete;

  // From an index in memory, what is still queued included.
  bool contains(BlockKey key) const;
  std::size_t size() const;                 ///< blocks
  std::vector<BlockKey> keys() const;       ///< sorted
  std::uint64_t bytes() const;              ///< of all blocks
  std::size_t surfels(BlockKey key) const;  ///< of one block; 0 if it is not there

  /// Queues blocks (without bytes: to be erased) to be written in one transaction by a thread in the background. Waits while more than
  /// 64 MB are queued.
  /// @throws FileError  an earlier transaction could not be written: it stays queued and is tried again from now on, and `blocks` is
  ///                    as it was before the call
  void write(std::vector<StoredBlock>&& blocks);

  /// The newest bytes of a block, be they queued or written; none if there is no such block. @throws FileError  the block is damaged
  std::vector<std::uint8_t> read(BlockKey key) const;

  /// Waits until all is written. @throws FileError  it could not be, or the folder is gone; all that is missing stays queued
  void flush();

  /// Why what is queued could not be written at the last try; empty if all is well. From any thread.
  std::string fault() const;

  /// Erases all blocks, and forgets what could not be written.
  void clear();

 private:
  struct Batch {
    std::vector<StoredBlock> blocks;
    bool clear;             ///< erases everything before
    std::size_t bytes;      ///< in memory
    bool obsolete = false;  ///< everything has been erased since; its writing may fail
  };
  void enqueue(Batch&& batch);
  void index(const StoredBlock& block);
  void throw_failure();
  void write_queued();
  void written();

  MapDatabase database_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  struct Size {
    std::size_t bytes, surfels;
  };
  std::unordered_map<BlockKey, Size> sizes_;                               ///< of each block
  std::uint64_t bytes_ = 0;                                                ///< their sum
  std::list<Batch> queue_;                                                 ///< the thread reads the first one without the mutex
  std::unordered_map<BlockKey, const std::vector<std::uint8_t>*> queued_;  ///< newest bytes of each block in queue_
  std::size_t queued_bytes_ = 0;
  bool writing_ = false;  ///< the first of queue_
  std::string failure_;   ///< why the first of queue_ could not be written; nothing is written until it was told
  std::string fault_;     ///< the same, until it is written
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace frontier_surfels
