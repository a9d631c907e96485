/// The map folder as it lies on disk: an SQLite database with one row a block. Whoever calls waits for the disk.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "map/block_key.hpp"

namespace frontier_surfels {

/// One thread may write while others read. All members throw FileError.
class MapDatabase {
 public:
  /// See MapFolder.
  MapDatabase(const std::string& folder, double block_size);
  ~MapDatabase();

  /// Calls visit(key, number of bytes, number of surfels) for every block.
  void for_each_block(const std::function<void(BlockKey, std::size_t, std::size_t)>& visit) const;

  /// One transaction: all or nothing. @param clear  erases everything before
  /// @throws FileError  also if the folder has been deleted, moved or replaced
  void write(const std::vector<StoredBlock>& blocks, bool clear);

  /// The bytes of a block that is there. @throws FileError  also if they are not those that were written
  std::vector<std::uint8_t> read(BlockKey key) const;

 private:
  class Lock;
  struct Connections;
  void check_place() const;

  std::string folder_, file_;
  std::pair<std::uint64_t, std::uint64_t> place_;  ///< of file_ when it was opened: numbers of the disk and of the file on it
  std::unique_ptr<Lock> lock_;
  std::unique_ptr<Connections> connections_;
};

}  // namespace frontier_surfels
