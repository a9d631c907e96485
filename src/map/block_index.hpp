/// Index of the map's pages: which pages belong to which block of the world.
#pragma once

#include <unordered_map>
#include <vector>

#include "map/block_key.hpp"

namespace frontier_surfels {

class BlockIndex {
 public:
  using Pages = std::vector<std::uint32_t>;

  /// Pages of a block in the order in which they were added; nullptr if the block has none.
  const Pages* find(const BlockKey& block) const;

  /// Adds one page to a block: a free page if there is one, else the page at end(). @return number of the page
  std::uint32_t add_page(const BlockKey& block);

  /// Removes a page from its block and makes it free. Does nothing if the page is not the block's.
  void remove_page(const BlockKey& block, std::uint32_t page);

  /// Raises end() to `end` if it is lower. The pages in between become free; the lowest of them is used first.
  void skip_to(std::size_t end);

  std::size_t end() const { return end_; }                  ///< one past the last page ever used
  std::size_t used() const { return end_ - free_.size(); }  ///< pages that belong to a block
  std::size_t bytes() const;                                ///< host memory of the index, estimated
  const std::unordered_map<BlockKey, Pages>& blocks() const { return blocks_; }

 private:
  std::unordered_map<BlockKey, Pages> blocks_;
  Pages free_;  ///< add_page() takes the last one
  std::uint32_t end_ = 0;
};

}  // namespace frontier_surfels
