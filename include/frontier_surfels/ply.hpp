/// Surfels as PLY files: binary little endian, vertex properties x y z nx ny nz radius (float), red green blue label (uchar; 1 occupied, 0
/// frontier). What has been seen may follow as a second element, seen_block with the properties x y z (int) and bytes (list), which programs
/// that look for a point cloud pass over.
#pragma once

#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Writes to `path`.tmp-* first, flushes it and renames it: an existing file is replaced whole or not at all. A checksum goes into a header
/// comment.
/// @throws FileError
void write_ply(const std::string& path, const std::vector<Surfel>& surfels, const SeenSpace& seen = {});

/// Reads what write_ply has written; ids are counted from 0. @throws FileError if the file is truncated, damaged or of another layout
std::vector<Surfel> read_ply(const std::string& path);

/// As read_ply(), with what has been seen. @throws FileError
SavedMap read_saved_ply(const std::string& path);

}  // namespace frontier_surfels
