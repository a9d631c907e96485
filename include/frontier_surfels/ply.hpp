/// Surfels as PLY files: binary little endian, vertex properties x y z nx ny nz radius (float), red green blue label (uchar; 1 occupied, 0
/// frontier). What has been seen and the kept views may follow as an element `seen` of bytes, which other programs pass over and which
/// only read_saved_ply() reads.
#pragma once

#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Writes to `path`.tmp-* first, flushes it and renames it: an existing file is replaced whole or not at all. A checksum goes into a header
/// comment.
/// @throws FileError
void write_ply(const std::string& path, const std::vector<Surfel>& surfels);

/// The same for a whole map. @throws FileError
void write_ply(const std::string& path, const SavedMap& map);

/// Reads what write_ply has written; ids are counted from 0. @throws FileError if the file is truncated, damaged or of another layout
std::vector<Surfel> read_ply(const std::string& path);

/// As read_ply(), with what has been seen and the kept views. @throws FileError
SavedMap read_saved_ply(const std::string& path);

}  // namespace frontier_surfels
