/// Which pages of the map belong to which block of the world.
#pragma once

#include <unordered_map>
#include <vector>

#include "map/block_key.hpp"

namespace frontier_surfels {

class BlockIndex {
 public:
  using Pages = std::vector<std::uint32_t>;

  /// Pages of a block in the order in which it got them; nullptr if it has none.
  const Pages* find(const BlockKey& block) const;

  /// Gives a block one page more: one that is free, or one beyond the end. @return its number
  std::uint32_t add_page(const BlockKey& block);

  /// Takes a page from its block.
  void remove_page(const BlockKey& block, std::uint32_t page);

  /// Makes the pages up to `end` free, if they were beyond the end: they have been used before.
  void skip_to(std::size_t end);

  std::size_t end() const { return end_; }                  ///< one past the last page ever used
  std::size_t used() const { return end_ - free_.size(); }  ///< pages that belong to a block
  std::size_t bytes() const;                                ///< on the host, about
  const std::unordered_map<BlockKey, Pages>& blocks() const { return blocks_; }

 private:
  std::unordered_map<BlockKey, Pages> blocks_;
  Pages free_;  ///< taken from the end
  std::uint32_t end_ = 0;
};

}  // namespace frontier_surfels
