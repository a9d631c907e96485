/// The table of blocks: values, and the blocks in a window.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <vector>

#include "map/block_map.hpp"

namespace frontier_surfels {
namespace {

/// A block of a window: its cell, its key, its value.
struct Found {
  int cell;
  BlockKey block;
  int value;
};
bool operator<(const Found& a, const Found& b) { return a.cell < b.cell; }
bool operator==(const Found& a, const Found& b) { return a.cell == b.cell && a.block == b.block && a.value == b.value; }

std::vector<Found> found_in(const BlockMap<int>& map, const Window& window) {
  std::vector<Found> found;
  map.for_each_in(window, [&](int cell, const BlockKey& block, int value) { found.push_back({cell, block, value}); });
  std::sort(found.begin(), found.end());
  return found;
}

/// The same, cell by cell.
std::vector<Found> expected_in(const std::map<BlockKey, int>& values, const Window& window) {
  std::vector<Found> expected;
  int cell = 0;
  for (int z = 0; z < window.size_z; ++z)
    for (int y = 0; y < window.size_y; ++y)
      for (int x = 0; x < window.size_x; ++x, ++cell) {
        const BlockKey block = {window.origin_x + x, window.origin_y + y, window.origin_z + z};
        if (const auto at = values.find(block); at != values.end()) expected.push_back({cell, block, at->second});
      }
  return expected;
}

TEST(BlockMap, HasNothingAtFirst) {
  const BlockMap<int> map;
  EXPECT_EQ(map.find({0, 0, 0}), nullptr);
  EXPECT_TRUE(map.table().empty());
  EXPECT_EQ(map.bytes(), 0u);
  EXPECT_TRUE(found_in(map, {-5, -5, -5, 10, 10, 10, 1}).empty());
}

TEST(BlockMap, KeepsValues) {
  BlockMap<int> map;
  EXPECT_EQ(map.at_or_new({-1, 2, -3}), 0);
  map.at_or_new({-1, 2, -3}) = 7;
  map.at_or_new({3, 2, 1}) = 8;
  ASSERT_NE(map.find({-1, 2, -3}), nullptr);
  EXPECT_EQ(*map.find({-1, 2, -3}), 7);
  EXPECT_EQ(map.at_or_new({3, 2, 1}), 8);
  EXPECT_EQ(map.find({1, 2, 3}), nullptr);
  map.erase({1, 2, 3});
  map.erase({-1, 2, -3});
  EXPECT_EQ(map.find({-1, 2, -3}), nullptr);
  EXPECT_EQ(map.table().size(), 1u);
  const std::size_t bytes = map.bytes();
  map.erase({3, 2, 1});
  EXPECT_GT(bytes, 0u);
  EXPECT_EQ(map.bytes(), 0u) << "words without blocks stay";
}

TEST(BlockMap, FindsTheBlocksInAWindow) {
  std::mt19937 random(7);
  const auto between = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
  for (int round = 0; round < 100; ++round) {
    BlockMap<int> map;
    std::map<BlockKey, int> values;
    const int reach = between(1, 12), changes = between(0, 300);
    for (int n = 0; n < changes; ++n) {
      const BlockKey block = {between(-reach, reach), between(-reach, reach), between(-reach, reach)};
      if (between(0, 3) == 0) {
        map.erase(block);
        values.erase(block);
      } else {
        map.at_or_new(block) = values[block] = n;
      }
    }
    EXPECT_EQ(map.table().size(), values.size());
    for (int n = 0; n < 5; ++n) {
      const Window window = {between(-15, 10), between(-15, 10), between(-15, 10), between(1, 20), between(1, 20), between(1, 20), 0.5F};
      EXPECT_EQ(found_in(map, window), expected_in(values, window)) << "round " << round;
    }
  }
}

}  // namespace
}  // namespace frontier_surfels
