/// Random points of a lattice, seen ones or ones that were taken back, and what a point of the world is told of them.
#pragma once

#include <vector>

#include "map/seen_block.hpp"
#include "map/seen_points.hpp"
#include "random_input.hpp"
#include "reference_field.hpp"
#include "seen_bits.hpp"

namespace frontier_surfels::reference {

/// Fills the blocks of a window with bricks of every kind: empty, full, cut by a plane, and of single points. open_window() must follow.
/// @param full   share of the bricks, and of the blocks that are uniform as a whole, that are full
/// @param mixed  share of the bricks with points of both kinds
inline void fill_lattice(SeenPoints& points, const MapWindow& window, double full, double mixed, Random& random) {
  std::vector<SeenBlock> blocks;
  for (int cell = 0; cell < window.cells(); ++cell) {
    SeenBlockBytes bytes;
    const bool uniform = random.chance(0.5), all_full = random.chance(full);
    for (int brick = 0; brick < points.bricks_of_block(); ++brick) {
      if (uniform || !random.chance(mixed)) {
        bytes.add_uniform((uniform ? all_full : random.chance(full)) ? SEEN_ALL : SEEN_NONE);
        continue;
      }
      const int axis = random.whole(0, 2), cut = random.whole(1, SEEN_BRICK - 1);
      const bool single = random.chance(0.3);
      bytes.add_points([&](int n) { return single ? random.chance(0.3) : (n >> (4 * axis) & (SEEN_BRICK - 1)) < cut; });
    }
    blocks.push_back({window.block(cell), bytes.take()});
  }
  points.add_blocks(blocks);
}

/// The points in a window: kernels know no others.
inline SeenBits bits_in_window(SeenPoints& points, const MapWindow& window) {
  SeenSpace all = points.saved(), inside = {all.block_size, all.points, {}};
  for (int cell = 0; cell < window.cells(); ++cell) {
    const BlockKey key = window.block(cell);
    for (const SeenSpace::Block& block : all.blocks)
      if (block.block[0] == key.x && block.block[1] == key.y && block.block[2] == key.z) inside.blocks.push_back(block);
  }
  return SeenBits(inside);
}

/// Does a point of the world lie among the lattice's points: are more than SEEN_SHARE of the 8 around it set?
inline Truth is_among(const SeenBits& bits, const Eigen::Vector3d& p_world) { return !less(bits.share(p_world), SEEN_SHARE + 1e-12, 1e-3); }

}  // namespace frontier_surfels::reference
