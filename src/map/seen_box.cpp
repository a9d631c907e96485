#include "map/seen_box.hpp"

#include <algorithm>
#include <cmath>

#include "common/shared.h"
#include "map/seen_block.hpp"

namespace frontier_surfels {

PointRange PointRange::in_brick(const BlockKey& block, int shift, int brick) const {
  const int sides = (1 << shift) - 1;
  const Eigen::Array3i low = (Eigen::Array3i(block.x << shift, block.y << shift, block.z << shift) +
                              Eigen::Array3i(brick & sides, brick >> shift & sides, brick >> 2 * shift)) *
                             SEEN_BRICK;
  return {(first - low).max(0), (end - low).min(SEEN_BRICK)};
}

PointRange points_in(const Eigen::AlignedBox3d& box, double spacing) {
  constexpr double kFar = 1 << 30;  // no block is as far away, and differences of such numbers are whole numbers of 32 bits
  const auto limited = [](const Eigen::Array3d& point) { return point.max(-kFar).min(kFar - 1).cast<int>().eval(); };
  return {limited((box.min().array() / spacing - 0.5).ceil()), limited((box.max().array() / spacing - 0.5).floor()) + 1};
}

std::vector<std::uint8_t> without_points(const std::vector<std::uint8_t>& bytes, const BlockKey& block, int shift,
                                         const PointRange& points) {
  if (bytes.empty()) return {};
  const int bricks = 1 << (3 * shift);
  check_seen_block(bytes, static_cast<std::size_t>(bricks));
  SeenBlockBytes left;
  bool any_left = false;
  auto next = bytes.begin() + bricks;
  for (int brick = 0; brick < bricks; ++brick) {
    const std::uint8_t state = bytes[brick];
    std::vector<std::uint8_t> words(kBrickBytes, state == SEEN_ALL ? 0xff : 0);
    if (state == SEEN_MIXED) {
      std::copy_n(next, kBrickBytes, words.begin());
      next += kBrickBytes;
    }
    const PointRange inside = points.in_brick(block, shift, brick);
    for (int z = inside.first.z(); z < inside.end.z(); ++z)
      for (int y = inside.first.y(); y < inside.end.y(); ++y)
        for (int x = inside.first.x(); x < inside.end.x(); ++x) {
          const int bit = seen_bit((z * SEEN_BRICK + y) * SEEN_BRICK + x);
          words[bit / 8] &= static_cast<std::uint8_t>(~(1 << bit % 8));
        }
    const bool is_left = std::any_of(words.begin(), words.end(), [](std::uint8_t byte) { return byte != 0; });
    if (is_left && (state == SEEN_MIXED || !inside.empty()))
      left.add_words(words);
    else
      left.add_uniform(is_left ? state : SEEN_NONE);
    any_left = any_left || is_left;
  }
  return any_left ? left.take() : std::vector<std::uint8_t>();
}

}  // namespace frontier_surfels
