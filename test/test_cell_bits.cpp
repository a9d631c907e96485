// Whether cells hang together, asked of bits, against a slow and obvious answer.
#include <gtest/gtest.h>

#include <deque>
#include <random>
#include <set>

#include "planner/cell_bits.hpp"

namespace frontier_surfels {
namespace {

struct Cell {
  BlockKey key;
};
struct Box {
  BlockKey low, high;
};

bool slowly_connected(std::set<BlockKey> open) {
  std::deque<BlockKey> next = {*open.begin()};
  open.erase(open.begin());
  for (; !next.empty(); next.pop_front())
    for (int n = 0; n < 27; ++n) {
      const BlockKey other = {next.front().x + n % 3 - 1, next.front().y + n / 3 % 3 - 1, next.front().z + n / 9 - 1};
      if (open.erase(other) > 0) next.push_back(other);
    }
  return open.empty();
}

bool quickly_connected(const std::set<BlockKey>& keys, const Box& box) {
  std::deque<Cell> cells;
  std::vector<const Cell*> pointers;
  for (const BlockKey& key : keys) {
    cells.push_back({key});
    pointers.push_back(&cells.back());
  }
  return CellBits(pointers, box).are_connected();
}

TEST(CellBits, AgreeWithAFloodFromCellToCell) {
  std::mt19937 random(1);
  int connected = 0, rounds = 3000;
  for (int round = 0; round < rounds; ++round) {
    const auto number = [&](int below) { return static_cast<int>(random() % static_cast<unsigned>(below)); };
    const BlockKey low = {number(20) - 10, number(20) - 10, number(20) - 10};
    const int x = 1 + number(6), y = 1 + number(6), z = 1 + number(round % 2 == 0 ? 64 : 6);
    std::set<BlockKey> keys;
    const int count = 1 + number(x * y * z);
    for (int n = 0; n < count; ++n) keys.insert({low.x + number(x), low.y + number(y), low.z + number(z)});
    const bool expected = slowly_connected(keys);
    ASSERT_EQ(quickly_connected(keys, {low, {low.x + x - 1, low.y + y - 1, low.z + z - 1}}), expected) << "round " << round;
    connected += expected;
  }
  EXPECT_GT(connected, rounds / 10);
  EXPECT_LT(connected, rounds * 9 / 10);
}

/// A path that turns back and forth is gone through by the fewest cells at a time, and lacks nothing but one cell in the middle.
TEST(CellBits, FollowAWindingPath) {
  std::set<BlockKey> keys;
  for (int y = 0; y < 61; ++y)
    for (int x = 0; x < 64; ++x)
      if (y % 2 == 0 || x == (y % 4 == 1 ? 63 : 0)) keys.insert({x, y, 63 * (y / 30 % 2)});
  for (int z = 0; z < 64; ++z) keys.insert({0, 30, z}), keys.insert({0, 60, z});
  const Box box = {{0, 0, 0}, {63, 60, 63}};
  ASSERT_TRUE(CellBits::fits(box));
  ASSERT_EQ(quickly_connected(keys, box), slowly_connected(keys));
  keys.erase({31, 10, 0});
  EXPECT_FALSE(quickly_connected(keys, box));
}

TEST(CellBits, DoNotFitLargerBoxes) {
  EXPECT_TRUE(CellBits::fits(Box{{-32, 0, 0}, {31, 0, 0}}));
  EXPECT_FALSE(CellBits::fits(Box{{-32, 0, 0}, {32, 0, 0}}));
  EXPECT_FALSE(CellBits::fits(Box{{0, 0, 0}, {0, 64, 0}}));
  EXPECT_FALSE(CellBits::fits(Box{{0, 0, 0}, {0, 0, 64}}));
}

}  // namespace
}  // namespace frontier_surfels
