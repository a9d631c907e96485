/// Index of the map's pages: which pages belong to which block of the world.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "map/block_map.hpp"

namespace frontier_surfels {

class BlockIndex {
 public:
  using Pages = std::vector<std::uint32_t>;

  /// Pages of a block in the order in which they were added; nullptr if the block has none.
  const Pages* find(const BlockKey& block) const { return blocks_.find(block); }

  /// Calls use(cell, block, pages) for the blocks in a window, in no particular order.
  template <typename Use>
  void for_each_in(const Window& window, const Use& use) const {
    blocks_.for_each_in(window, use);
  }

  /// Adds one page to a block: a free page if there is one, else the page at end(). @return number of the page
  std::uint32_t add_page(const BlockKey& block);

  /// The pages that the next calls of add_page() will return, if no pages are removed or released before.
  Pages next_pages(std::size_t count) const;

  /// Undoes the last add_page(), or after that the one before it. @param end  end() before the first one that will be undone
  void take_back(const BlockKey& block, std::uint32_t page, std::size_t end);

  /// Removes pages from their block, in one pass through its pages. From one on that is not the block's, or not in its order, they stay.
  /// @param frame  the pages become free by release(frame) or later; 0: they are free at once
  void remove_pages(const BlockKey& block, const Pages& removed, std::uint32_t frame = 0);
  void remove_page(const BlockKey& block, std::uint32_t page, std::uint32_t frame = 0) { remove_pages(block, {page}, frame); }

  /// Makes the pages free that have been removed in frames up to `frame`.
  void release(std::uint64_t frame);

  /// An index without blocks, but with the same end(). The lowest free page is used first.
  /// @param frame  the pages of this index's blocks become free by release(frame); 0: all pages are free at once
  BlockIndex emptied(std::uint32_t frame) const;

  std::size_t end() const { return end_; }                                    ///< one past the last page ever used
  std::size_t used() const { return end_ - free_.size() - removed_.size(); }  ///< pages that belong to a block
  std::size_t bytes() const;                                                  ///< host memory of the index, estimated
  const BlockMap<Pages>::Table& blocks() const { return blocks_.table(); }

 private:
  BlockMap<Pages> blocks_;
  Pages free_;                                                    ///< add_page() takes the last one
  std::vector<std::pair<std::uint32_t, std::uint32_t>> removed_;  ///< frame and page of those that are not free yet
  std::uint32_t end_ = 0;
};

}  // namespace frontier_surfels
