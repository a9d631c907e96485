/// A block of the world: its place, counted in blocks from the world's origin.
#pragma once

#include <cstddef>
#include <cstdint>
#include <tuple>

namespace frontier_surfels {

struct BlockKey {
  std::int32_t x = 0, y = 0, z = 0;
  bool operator==(const BlockKey& other) const { return x == other.x && y == other.y && z == other.z; }
  bool operator<(const BlockKey& other) const { return std::tie(z, y, x) < std::tie(other.z, other.y, other.x); }
};

struct BlockKeyHash {
  std::size_t operator()(const BlockKey& key) const {
    std::uint64_t mixed = static_cast<std::uint32_t>(key.x) * 0x9E3779B97F4A7C15U;
    mixed ^= static_cast<std::uint32_t>(key.y) * 0xC2B2AE3D27D4EB4FU;
    mixed ^= static_cast<std::uint32_t>(key.z) * 0x165667B19E3779F9U;
    return static_cast<std::size_t>(mixed ^ (mixed >> 32));
  }
};

}  // namespace frontier_surfels
