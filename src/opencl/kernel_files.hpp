/// The kernels' source, embedded at build time.
#pragma once

#include <string>
#include <vector>

namespace frontier_surfels {

struct KernelFile {
  std::string name;
  std::string text;
};

/// All files of kernels/, in the order in which they are compiled.
const std::vector<KernelFile>& kernel_files();

}  // namespace frontier_surfels
