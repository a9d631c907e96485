/// The index of pages: adding, removing and reusing pages.

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "map/block_index.hpp"
#include "stages/random_input.hpp"

namespace frontier_surfels {
namespace {

using Pages = BlockIndex::Pages;

TEST(BlockIndex, IsEmptyAtFirst) {
  const BlockIndex index;
  EXPECT_EQ(index.find({0, 0, 0}), nullptr);
  EXPECT_EQ(index.end(), 0u);
  EXPECT_EQ(index.used(), 0u);
  EXPECT_TRUE(index.blocks().empty());
}

TEST(BlockIndex, CountsPagesUp) {
  BlockIndex index;
  EXPECT_EQ(index.add_page({1, -2, 3}), 0u);
  EXPECT_EQ(index.add_page({-1, 2, -3}), 1u);
  EXPECT_EQ(index.add_page({1, -2, 3}), 2u);
  EXPECT_EQ(*index.find({1, -2, 3}), (Pages{0, 2}));
  EXPECT_EQ(*index.find({-1, 2, -3}), Pages{1});
  EXPECT_EQ(index.find({3, -2, 1}), nullptr) << "coordinates are not interchangeable";
  EXPECT_EQ(index.end(), 3u);
  EXPECT_EQ(index.used(), 3u);
}

TEST(BlockIndex, ReusesFreePages) {
  BlockIndex index;
  const BlockKey a = {0, 0, 0}, b = {0, 0, 1};
  for (int n = 0; n < 3; ++n) index.add_page(a);
  index.remove_page(a, 1);
  EXPECT_EQ(*index.find(a), (Pages{0, 2}));
  EXPECT_EQ(index.end(), 3u);
  EXPECT_EQ(index.used(), 2u);
  EXPECT_EQ(index.add_page(b), 1u);
  EXPECT_EQ(index.add_page(b), 3u);
  EXPECT_EQ(*index.find(b), (Pages{1, 3}));
}

TEST(BlockIndex, TellsTheNextPages) {
  BlockIndex index;
  const BlockKey a = {0, 0, 0}, b = {0, 0, 1};
  EXPECT_EQ(index.next_pages(2), (Pages{0, 1}));
  for (int n = 0; n < 4; ++n) index.add_page(a);
  index.remove_pages(a, {0, 2});
  EXPECT_TRUE(index.next_pages(0).empty());
  EXPECT_EQ(index.next_pages(1), Pages{2});
  const Pages next = index.next_pages(4);
  EXPECT_EQ(next, (Pages{2, 0, 4, 5}));
  for (const std::uint32_t page : next) EXPECT_EQ(index.add_page(b), page);
}

TEST(BlockIndex, RemovesSeveralPagesAtOnce) {
  BlockIndex index;
  const BlockKey a = {0, 0, 0}, b = {0, 0, 1};
  for (int n = 0; n < 6; ++n) index.add_page(n == 3 ? b : a);
  index.remove_pages(a, {1, 5}, 0);
  EXPECT_EQ(*index.find(a), (Pages{0, 2, 4}));
  index.remove_pages(a, {3, 4}, 0);  // another block's page
  EXPECT_EQ(*index.find(b), (Pages{3}));
  EXPECT_EQ(index.add_page(b), 5u) << "the last one that became free";
  EXPECT_EQ(index.add_page(b), 1u);
  index.remove_pages(b, {3, 5, 1}, 7);
  EXPECT_EQ(index.find(b), nullptr);
  EXPECT_EQ(index.add_page(a), 6u) << "they wait";
  index.release(7);
  EXPECT_EQ(index.add_page(a), 1u);
  index.remove_pages({7, 0, 0}, {0}, 0);
  EXPECT_EQ(*index.find(a), (Pages{0, 2, 4, 6, 1}));
}

TEST(BlockIndex, ForgetsBlocksWithoutPages) {
  BlockIndex index;
  index.add_page({5, 5, 5});
  index.remove_page({5, 5, 5}, 0);
  EXPECT_EQ(index.find({5, 5, 5}), nullptr);
  EXPECT_TRUE(index.blocks().empty());
  EXPECT_EQ(index.used(), 0u);
}

TEST(BlockIndex, RemovesOnlyPagesOfTheBlock) {
  BlockIndex index;
  index.add_page({0, 0, 0});
  index.add_page({1, 0, 0});
  index.remove_page({0, 0, 0}, 1);  // another block's page
  index.remove_page({7, 0, 0}, 0);
  EXPECT_EQ(index.used(), 2u);
  EXPECT_EQ(index.add_page({2, 0, 0}), 2u);
}

/// Pages of a replaced map become free. The lowest is used first, as in a new map.
TEST(BlockIndex, EmptiedUsesThePagesAgain) {
  BlockIndex before;
  for (int n = 0; n < 4; ++n) before.add_page({n % 2, 0, 0});
  before.remove_page({0, 0, 0}, 2, 7);
  BlockIndex index = before.emptied(0);
  EXPECT_TRUE(index.blocks().empty());
  EXPECT_EQ(index.end(), 4u);
  EXPECT_EQ(index.used(), 0u);
  for (const std::uint32_t page : {0u, 1u, 2u, 3u, 4u}) EXPECT_EQ(index.add_page({1, 0, 0}), page);
}

TEST(BlockIndex, RemovedPagesWaitForTheirRelease) {
  BlockIndex index;
  for (int n = 0; n < 4; ++n) index.add_page({0, 0, 0});
  index.remove_page({0, 0, 0}, 1, 5);
  index.remove_page({0, 0, 0}, 2, 6);
  index.remove_page({0, 0, 0}, 3);
  EXPECT_EQ(index.used(), 1u);
  EXPECT_EQ(index.add_page({1, 0, 0}), 3u);
  index.release(4);
  EXPECT_EQ(index.add_page({1, 0, 0}), 4u);
  index.release(5);
  EXPECT_EQ(index.add_page({1, 0, 0}), 1u);
  EXPECT_EQ(index.add_page({1, 0, 0}), 5u);

  BlockIndex empty = index.emptied(8);
  EXPECT_EQ(empty.used(), 0u);
  EXPECT_EQ(empty.end(), 6u);
  EXPECT_EQ(empty.add_page({1, 0, 0}), 6u) << "all pages wait";
  empty.release(6);
  EXPECT_EQ(empty.add_page({1, 0, 0}), 2u);
  empty.release(8);
  std::set<std::uint32_t> left;
  for (int n = 0; n < 5; ++n) left.insert(empty.add_page({1, 0, 0}));
  EXPECT_EQ(left, (std::set<std::uint32_t>{0, 1, 3, 4, 5}));
}

TEST(BlockIndex, AgreesWithASimpleBookOfPages) {
  reference::Random random(1);
  BlockIndex index;
  std::map<BlockKey, Pages> book;
  std::set<std::uint32_t> used;
  std::size_t most = 0;
  for (int step = 0; step < 20000; ++step) {
    const BlockKey block = {random.whole(-3, 3), random.whole(-3, 3), random.whole(-1, 1)};
    Pages& pages = book[block];
    if (random.chance(step < 10000 ? 0.6 : 0.4)) {
      pages.push_back(index.add_page(block));
      EXPECT_TRUE(used.insert(pages.back()).second) << "a page is given twice";
    } else if (!pages.empty()) {
      const auto at = pages.begin() + random.whole(0, static_cast<int>(pages.size()) - 1);
      index.remove_page(block, *at);
      used.erase(*at);
      pages.erase(at);
    }
    most = std::max(most, used.size());
    ASSERT_EQ(index.used(), used.size());
    ASSERT_EQ(index.end(), most) << "free pages are used first";
  }
  for (const auto& [block, pages] : book) {
    const Pages* found = index.find(block);
    EXPECT_TRUE(pages.empty() ? found == nullptr : found != nullptr && *found == pages);
  }
}

}  // namespace
}  // namespace frontier_surfels
