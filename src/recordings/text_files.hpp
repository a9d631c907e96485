/// The text files of recorded sequences: one record a line, '#' starts a comment.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels::replay {

struct StampedPose {
  double stamp = 0;          ///< [s]
  std::vector<double> pose;  ///< tx ty tz [m] qx qy qz qw, as written: may be NaN
};

struct StampedFile {
  double stamp = 0;  ///< [s]
  std::string file;
};

/// Lines `stamp tx ty tz qx qy qz qw`. @throws Error naming the line that is something else
std::vector<StampedPose> read_poses(const std::filesystem::path& path);

/// Lines `stamp file`. @throws Error naming the line that is something else
std::vector<StampedFile> read_file_list(const std::filesystem::path& path);

/// One line `fx fy cx cy width height`. @throws Error
Intrinsics read_camera(const std::filesystem::path& path);

}  // namespace frontier_surfels::replay
