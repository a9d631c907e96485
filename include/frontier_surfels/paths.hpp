/// Paths as people write them.
#pragma once

#include <string>

namespace frontier_surfels {

/// A path without `~` and from the root of the file system on. `~` alone or before the first `/` is the user's home folder ($HOME, else
/// that of the user's account); without a home it stays. Other paths begin in the current folder. An empty path stays empty.
std::string absolute_path(const std::string& path);

}  // namespace frontier_surfels
