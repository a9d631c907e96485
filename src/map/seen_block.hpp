/// What is remembered of a block (seen_points.hpp), as bytes for files and the archive: a state for each brick (SEEN_NONE, SEEN_MIXED,
/// SEEN_ALL), in the order of the block's table, and then the words of the bricks with SEEN_MIXED. No bytes: no point is seen.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "common/shared.h"

namespace frontier_surfels {

constexpr std::size_t kBrickBytes = SEEN_WORDS * sizeof(std::uint64_t);

/// Number of a point's bit in the bytes of its brick. Points are numbered (z SEEN_BRICK + y) SEEN_BRICK + x.
inline int seen_bit(int point) {
  const int x = point % SEEN_BRICK, y = point / SEEN_BRICK % SEEN_BRICK, z = point / SEEN_BRICK / SEEN_BRICK;
  const int word = (z / 4 * 4 + y / 4) * 4 + x / 4, bit = (z % 4 * 4 + y % 4) * 4 + x % 4;
  return 64 * word + bit;
}

/// Makes the bytes of a block brick by brick.
class SeenBlockBytes {
 public:
  void add_uniform(std::uint8_t state) { states_.push_back(state); }

  /// @param is_seen  of a point, by its number
  void add_points(const std::function<bool(int)>& is_seen);

  /// @param words  kBrickBytes bytes
  void add_words(const std::vector<std::uint8_t>& words);
  std::vector<std::uint8_t> take();

 private:
  std::vector<std::uint8_t> states_, words_;
};

/// @param bricks  number of bricks of a block
/// @throws FileError  the bytes are damaged, or those of another lattice
void check_seen_block(const std::vector<std::uint8_t>& bytes, std::size_t bricks);

/// The points of a block that are seen in either of two memories. @throws FileError  as check_seen_block()
std::vector<std::uint8_t> united_seen_blocks(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b, std::size_t bricks);

}  // namespace frontier_surfels
