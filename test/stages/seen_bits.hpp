/// Seen points as a file keeps them, point by point: slow and obvious.
#pragma once

#include <algorithm>
#include <map>

#include "common/shared.h"
#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"

namespace frontier_surfels::reference {

class SeenBits {
 public:
  explicit SeenBits(const SeenSpace& seen) : points_(seen.points), spacing_(seen.block_size / seen.points) {
    for (const auto& block : seen.blocks) blocks_[{block.block[0], block.block[1], block.block[2]}] = block.bytes;
  }

  double spacing() const { return spacing_; }  ///< [m]
  const std::map<BlockKey, std::vector<std::uint8_t>>& blocks() const { return blocks_; }
  int points() const { return points_; }

  /// Is a point of the lattice seen? It is counted along the axes from the world's origin.
  bool seen(int x, int y, int z) const {
    const auto found = blocks_.find({floor_divide(x), floor_divide(y), floor_divide(z)});
    if (found == blocks_.end()) return false;
    const std::vector<std::uint8_t>& bytes = found->second;
    const int sides = points_ / SEEN_BRICK, i = modulo(x), j = modulo(y), k = modulo(z);
    const int brick = (k / SEEN_BRICK * sides + j / SEEN_BRICK) * sides + i / SEEN_BRICK;
    if (bytes[brick] != SEEN_MIXED) return bytes[brick] == SEEN_ALL;
    const auto before = std::count(bytes.begin(), bytes.begin() + brick, SEEN_MIXED);
    const auto in_brick = [](int n) { return n % SEEN_BRICK; };
    const int word = (in_brick(k) / 4 * 4 + in_brick(j) / 4) * 4 + in_brick(i) / 4, bit = (k % 4 * 4 + j % 4) * 4 + i % 4;
    return bytes[sides * sides * sides + 8 * (SEEN_WORDS * before + word) + bit / 8] >> (bit % 8) & 1;
  }

  /// Share of the 8 points around that are seen, weighted trilinearly.
  double share(const Eigen::Vector3d& p_world) const {
    const Eigen::Array3d q = p_world.array() / spacing_ - 0.5, low = q.floor(), part = q - low;
    double sum = 0;
    for (int n = 0; n < 8; ++n) {
      const Eigen::Array3i side(n & 1, n >> 1 & 1, n >> 2);
      const Eigen::Array3d weight = (side == 1).select(part, 1 - part);
      if (seen(static_cast<int>(low.x()) + side.x(), static_cast<int>(low.y()) + side.y(), static_cast<int>(low.z()) + side.z()))
        sum += weight.prod();
    }
    return sum;
  }

 private:
  int floor_divide(int a) const { return a / points_ - (a % points_ < 0 ? 1 : 0); }
  int modulo(int a) const { return a - floor_divide(a) * points_; }

  int points_;
  double spacing_;
  std::map<BlockKey, std::vector<std::uint8_t>> blocks_;
};

}  // namespace frontier_surfels::reference
