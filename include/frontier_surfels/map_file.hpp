/// Saved maps. The ending of the path, .ply or .pcd in small or capital letters, decides the format.
#pragma once

#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Writes the surfels by write_ply or write_pcd. @throws FileError  also if the path has another ending
void write_map(const std::string& path, const std::vector<Surfel>& surfels);

/// As above; a PLY file also keeps what has been seen and the kept views, a PCD file the surfels alone.
void write_map(const std::string& path, const SavedMap& map);

/// Reads a whole map. What has been seen is empty where the file does not have it. @throws FileError
SavedMap read_saved_map(const std::string& path);

/// Reads the surfels by read_ply or read_pcd. @throws FileError  also if the path has another ending
std::vector<Surfel> read_map(const std::string& path);

}  // namespace frontier_surfels
