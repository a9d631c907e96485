/// A table with a value for each of some blocks of the world, which finds those in a window fast.
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "common/shared.h"
#include "map/bits.hpp"
#include "map/block_key.hpp"

namespace frontier_surfels {

/// Beside the table there is a bit for each of its blocks, in words of 4 x 4 x 4 blocks: most blocks of a window are not in the table, and
/// each look-up waits for memory.
template <typename Value>
class BlockMap {
 public:
  using Table = std::unordered_map<BlockKey, Value>;

  const Table& table() const { return table_; }

  /// The value of a block; nullptr if there is none. It stays in its place until the block is erased.
  const Value* find(const BlockKey& block) const {
    const auto found = table_.find(block);
    return found == table_.end() ? nullptr : &found->second;
  }
  Value* find(const BlockKey& block) { return const_cast<Value*>(std::as_const(*this).find(block)); }

  /// The value of a block, which is Value() if the block is new. No block has changed if memory runs out.
  Value& at_or_new(const BlockKey& block) {
    if (Value* found = find(block); found != nullptr) return *found;
    std::uint64_t& word = words_[word_of(block)];
    Value& value = table_[block];
    word |= bit_of(block);
    return value;
  }

  void erase(BlockKey block) {
    if (table_.erase(block) == 0) return;
    const auto word = words_.find(word_of(block));
    word->second &= ~bit_of(block);
    if (word->second == 0) words_.erase(word);
  }

  /// Calls use(cell, block, value) for the blocks in a window, in no particular order. @param use  gets the number of the window's cell
  template <typename Use>
  void for_each_in(const Window& window, const Use& use) const {
    const BlockKey first = {window.origin_x, window.origin_y, window.origin_z};
    const BlockKey low = word_of(first),
                   high = word_of({first.x + window.size_x - 1, first.y + window.size_y - 1, first.z + window.size_z - 1});
    const auto along = [](int from, int to) { return static_cast<std::size_t>(to - from + 1); };
    if (words_.size() < along(low.x, high.x) * along(low.y, high.y) * along(low.z, high.z)) {
      for (const auto& [word, bits] : words_) use_word(window, word, bits, use);
      return;
    }
    for (int z = low.z; z <= high.z; ++z)
      for (int y = low.y; y <= high.y; ++y)
        for (int x = low.x; x <= high.x; ++x) {
          const auto word = words_.find({x, y, z});
          if (word != words_.end()) use_word(window, word->first, word->second, use);
        }
  }

  /// Memory that it takes, estimated, without what the values allocate themselves.
  std::size_t bytes() const {
    constexpr std::size_t kOfNode = 2 * sizeof(void*) + 8;  // of a hash table, with its bucket
    return table_.size() * (sizeof(typename Table::value_type) + kOfNode) +
           words_.size() * (sizeof(typename decltype(words_)::value_type) + kOfNode);
  }

 private:
  /// Shifts of negative numbers round down, as must be here.
  static BlockKey word_of(const BlockKey& block) { return {block.x >> 2, block.y >> 2, block.z >> 2}; }
  static std::uint64_t bit_of(const BlockKey& block) {
    return std::uint64_t{1} << ((block.z & 3) << 4 | (block.y & 3) << 2 | (block.x & 3));
  }

  template <typename Use>
  void use_word(const Window& window, const BlockKey& word, std::uint64_t bits, const Use& use) const {
    for_each_bit(bits, [&](std::uint32_t number) {
      const int bit = static_cast<int>(number);
      const BlockKey block = {4 * word.x + (bit & 3), 4 * word.y + (bit >> 2 & 3), 4 * word.z + (bit >> 4)};
      const int x = block.x - window.origin_x, y = block.y - window.origin_y, z = block.z - window.origin_z;
      if (x < 0 || y < 0 || z < 0 || x >= window.size_x || y >= window.size_y || z >= window.size_z) return;
      use((z * window.size_y + y) * window.size_x + x, block, table_.find(block)->second);
    });
  }

  Table table_;
  std::unordered_map<BlockKey, std::uint64_t> words_;
};

}  // namespace frontier_surfels
