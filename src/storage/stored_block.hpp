/// What the map folder keeps under its keys: blocks of the map, and kept views.
#pragma once

#include <cstdint>
#include <vector>

#include "map/block_key.hpp"

namespace frontier_surfels {

/// A block: its surfels (surfel_packing.hpp), and what has been seen in it (seen_points.hpp).
struct StoredParts {
  int shift = 0;  ///< of the lattice: SeenPoints::shift()
  std::vector<std::uint8_t> surfels, seen;
};

/// The bytes of a block: the shift and the number of bytes of the surfels (uint32 each), the surfels, and then what has been seen. None if
/// there are neither surfels nor seen points.
std::vector<std::uint8_t> join(const StoredParts& parts);

/// Number of a block's surfels, from its first kStoredHead bytes; 0 if there are fewer bytes.
std::size_t surfels_of(const std::uint8_t* bytes, std::size_t count);
constexpr std::size_t kStoredHead = 8;

/// @throws FileError  the bytes end too early
StoredParts parts_of(const std::vector<std::uint8_t>& bytes);

/// @name Keys of kept views, which no block has: blocks of the map lie within 1000 km of the origin
/// @{
BlockKey view_key(std::uint64_t number);
bool is_view(const BlockKey& key);
std::uint64_t number_of(const BlockKey& view_key);
/// @}

}  // namespace frontier_surfels
