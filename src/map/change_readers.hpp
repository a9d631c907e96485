/// Who follows the changes of the map, and how far each has got.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

namespace frontier_surfels {

/// A reader is known by the number of the map that it has got last: it asks for the changes since that number.
class ChangeReaders {
 public:
  /// A reader of the map `since` has got the changes up to the map `sequence`. A new reader begins with since = 0.
  void note(std::uint64_t since, std::uint64_t sequence) {
    const auto reader = readers_.find(since);
    if (reader != readers_.end() && --reader->second == 0) readers_.erase(reader);
    ++readers_[sequence];
  }

  /// Forgets readers that have asked for nothing since long before the map `sequence`. @return whether there were any
  bool forget_lost_ones(std::uint64_t sequence) {
    const std::uint64_t oldest = sequence > kLongestWait ? sequence - kLongestWait : 0;
    const auto end = readers_.lower_bound(oldest);
    const bool any = end != readers_.begin();
    readers_.erase(readers_.begin(), end);
    return any;
  }

  /// The maps that readers have, ascending.
  std::vector<std::uint64_t> maps() const {
    std::vector<std::uint64_t> maps;
    for (const auto& [sequence, count] : readers_) maps.push_back(sequence);
    return maps;
  }

  /// Is a reader of this map known, or of an earlier one?
  bool knows(std::uint64_t since) const { return !readers_.empty() && since >= readers_.begin()->first; }

  static constexpr std::uint64_t kLongestWait = 1000;  ///< frames: half a minute, after which a reader is taken for gone

 private:
  std::map<std::uint64_t, std::size_t> readers_;  ///< number of readers by the map that they have
};

}  // namespace frontier_surfels
