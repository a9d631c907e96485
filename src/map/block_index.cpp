#include "map/block_index.hpp"

#include <algorithm>

namespace frontier_surfels {

std::uint32_t BlockIndex::add_page(const BlockKey& block) {
  std::uint32_t page = end_;
  Pages& pages = blocks_.at_or_new(block);
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

BlockIndex::Pages BlockIndex::next_pages(std::size_t count) const {
  Pages next(free_.rbegin(), free_.rbegin() + static_cast<std::ptrdiff_t>(std::min(count, free_.size())));
  for (std::uint32_t page = end_; next.size() < count; ++page) next.push_back(page);
  return next;
}

void BlockIndex::take_back(const BlockKey& block, std::uint32_t page, std::size_t end) {
  Pages* pages = blocks_.find(block);
  pages->pop_back();
  if (pages->empty()) blocks_.erase(block);
  if (page >= end)
    --end_;
  else
    free_.push_back(page);
}

void BlockIndex::remove_pages(const BlockKey& block, const Pages& removed, std::uint32_t frame) {
  Pages* found = blocks_.find(block);
  if (found == nullptr) return;
  Pages& pages = *found;
  auto next = removed.begin();
  auto kept = pages.begin();
  for (const std::uint32_t page : pages) {
    if (next == removed.end() || page != *next) {
      *kept++ = page;
      continue;
    }
    ++next;
    if (frame == 0)
      free_.push_back(page);
    else
      removed_.emplace_back(frame, page);
  }
  pages.erase(kept, pages.end());
  if (pages.empty()) blocks_.erase(block);
}

void BlockIndex::release(std::uint64_t frame) {
  const auto stays = [&](const auto& removed) { return removed.first > frame; };
  const auto released = std::stable_partition(removed_.begin(), removed_.end(), stays);
  for (auto at = released; at != removed_.end(); ++at) free_.push_back(at->second);
  removed_.erase(released, removed_.end());
}

BlockIndex BlockIndex::emptied(std::uint32_t frame) const {
  BlockIndex empty;
  empty.end_ = end_;
  if (frame == 0) {
    for (std::uint32_t page = end_; page > 0;) empty.free_.push_back(--page);
    return empty;
  }
  empty.free_ = free_;
  std::sort(empty.free_.rbegin(), empty.free_.rend());  // descending, as add_page() takes the last
  empty.removed_ = removed_;
  for (const auto& [block, pages] : blocks())
    for (const std::uint32_t page : pages) empty.removed_.emplace_back(frame, page);
  std::sort(empty.removed_.begin(), empty.removed_.end());  // the table of blocks has no order
  return empty;
}

std::size_t BlockIndex::bytes() const {
  return blocks_.bytes() + used() * 2 * sizeof(std::uint32_t) + free_.capacity() * sizeof(std::uint32_t) +
         removed_.capacity() * sizeof(removed_[0]);
}

}  // namespace frontier_surfels
