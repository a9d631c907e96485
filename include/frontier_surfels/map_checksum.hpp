/// Whether two maps are the same, by a number for each.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// A checksum of all bits of the surfels' positions, normals, radii, labels and colours. Their order and ids do not matter. The same frames
/// and the same configuration give the same number on every device whose Mapper has no warning, and on any number of threads. It changes
/// where the method changes. 0 for a map without surfels.
std::uint64_t map_checksum(const std::vector<Surfel>& surfels);

/// The checksum as 16 hexadecimal digits: JSON's numbers are too short for it.
std::string checksum_text(std::uint64_t checksum);

}  // namespace frontier_surfels
