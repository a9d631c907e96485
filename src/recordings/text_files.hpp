/// Reads the text files of recordings: a record in each line; '#' starts a comment.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::replay {

struct StampedPose {
  double stamp = 0;          ///< [s]
  std::vector<double> pose;  ///< tx ty tz [m] qx qy qz qw, not checked: may be NaN
};

struct StampedFile {
  double stamp = 0;  ///< [s]
  std::string file;
};

/// Reads lines `stamp tx ty tz qx qy qz qw`. @throws Error that names the first line of another form
std::vector<StampedPose> read_poses(const std::filesystem::path& path);

/// Reads lines `stamp file`. @throws Error that names the first line of another form
std::vector<StampedFile> read_file_list(const std::filesystem::path& path);

/// Reads a file with the one line `fx fy cx cy width height`. @throws Error if it has another form
Intrinsics read_camera(const std::filesystem::path& path);

}  // namespace frontier_surfels::replay
