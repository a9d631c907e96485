/// Key of a block of the map: the cube of the world whose lowest corner is (x, y, z) times the block size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <tuple>
#include <utility>
#include <vector>

namespace frontier_surfels {

struct BlockKey {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t z = 0;
};

inline bool operator==(const BlockKey& a, const BlockKey& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
inline bool operator!=(const BlockKey& a, const BlockKey& b) { return !(a == b); }
inline bool operator<(const BlockKey& a, const BlockKey& b) { return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z); }

/// A block and its packed surfels as bytes. No bytes mean that the block is to be erased.
using StoredBlock = std::pair<BlockKey, std::vector<std::uint8_t>>;

}  // namespace frontier_surfels

/// Multiplies by large odd numbers and folds high bits into low ones, so that neighbouring blocks get very different hashes.
template <>
struct std::hash<frontier_surfels::BlockKey> {
  std::size_t operator()(const frontier_surfels::BlockKey& key) const noexcept {
    std::uint64_t h = static_cast<std::uint32_t>(key.x) * std::uint64_t{0x9E3779B97F4A7C15};
    h = (h ^ h >> 32 ^ static_cast<std::uint32_t>(key.y)) * std::uint64_t{0xBF58476D1CE4E5B9};
    h = (h ^ h >> 32 ^ static_cast<std::uint32_t>(key.z)) * std::uint64_t{0x94D049BB133111EB};
    return static_cast<std::size_t>(h ^ h >> 32);
  }
};
