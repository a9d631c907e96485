/// Surfels as PCD files, the format of PCL: fields x y z normal_x normal_y normal_z rgb radius confidence curvature (float), label id
/// (uint32; label 1 occupied, 0 frontier). PCL is not needed.
#pragma once

#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Writes a binary PCD file as write_ply writes a PLY file: whole or not at all, with a checksum in a comment of the header. `rgb` is the
/// surfel's colour, or where it has none that of its label (cloud_color.hpp); `confidence` is 1 for frontier and 0 for occupied;
/// `curvature` is 0. pcl::io::loadPCDFile reads the file into pcl::PointSurfel and every other type with some of these fields.
/// @throws FileError
void write_pcd(const std::string& path, const std::vector<Surfel>& surfels);

/// Reads what write_pcd has written, and ascii and binary files of other programs with at least x y z normal_x normal_y normal_z radius and
/// either label or confidence (above 0.5: frontier). `rgb` or `rgba` may be missing; other fields are skipped. Ids are counted from 0.
/// @throws FileError  the file is truncated, damaged, compressed, or lacks a field
std::vector<Surfel> read_pcd(const std::string& path);

}  // namespace frontier_surfels
