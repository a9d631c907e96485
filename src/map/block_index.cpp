#include "map/block_index.hpp"

#include <algorithm>

namespace frontier_surfels {

const BlockIndex::Pages* BlockIndex::find(const BlockKey& block) const {
  const auto found = blocks_.find(block);
  return found == blocks_.end() ? nullptr : &found->second;
}

std::uint32_t BlockIndex::add_page(const BlockKey& block) {
  std::uint32_t page = end_;
  Pages& pages = blocks_[block];
  if (free_.empty()) {
    pages.push_back(page);
    ++end_;
  } else {
    page = free_.back();
    pages.push_back(page);
    free_.pop_back();
  }
  return page;
}

void BlockIndex::remove_page(const BlockKey& block, std::uint32_t page) {
  const auto found = blocks_.find(block);
  if (found == blocks_.end()) return;
  Pages& pages = found->second;
  const auto at = std::find(pages.begin(), pages.end(), page);
  if (at == pages.end()) return;
  free_.push_back(page);
  pages.erase(at);
  if (pages.empty()) blocks_.erase(found);
}

void BlockIndex::skip_to(std::size_t end) {
  const Pages free = free_;
  free_.clear();
  for (auto page = static_cast<std::uint32_t>(end); page > end_;) free_.push_back(--page);  // descending, as add_page() takes the last
  free_.insert(free_.end(), free.begin(), free.end());
  end_ = std::max(end_, static_cast<std::uint32_t>(end));
}

std::size_t BlockIndex::bytes() const {
  constexpr std::size_t kNode = sizeof(BlockKey) + sizeof(Pages) + 2 * sizeof(void*) + 8;  // of the hash table, with its bucket
  return blocks_.size() * kNode + used() * 2 * sizeof(std::uint32_t) + free_.capacity() * sizeof(std::uint32_t);
}

}  // namespace frontier_surfels
