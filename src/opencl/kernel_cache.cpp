#include "opencl/kernel_cache.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>

#include "opencl/cache_folder.hpp"

namespace frontier_surfels {
namespace {

/// Makes the folder and a file in it, which goes at once.
std::error_code try_to_write(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return error;
  std::string file = (folder / "writable_XXXXXX").string();
  const int descriptor = mkstemp(file.data());
  if (descriptor < 0) return {errno, std::generic_category()};
  close(descriptor);
  unlink(file.c_str());
  return {};
}

}  // namespace

std::filesystem::path kernel_cache_folder() {
  const std::filesystem::path folder = cache_folder("POCL_CACHE_DIR", "pocl/kcache");
  return folder.empty() ? "/tmp/pocl/kcache" : folder;
}

std::string kernel_cache_fault(const std::filesystem::path& folder, std::uintmax_t needed) {
  const auto fault = [&](const std::string& why) {
    return "PoCL cannot keep compiled kernels in its cache folder " + folder.string() + ": " + why +
           ". Set the environment variable POCL_CACHE_DIR to a folder that can be written and has some MB of free space.";
  };
  if (const std::error_code error = try_to_write(folder)) return fault(error.message());
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  if (!error && space.available < needed)
    return fault("only " + std::to_string(space.available >> 10) + " kB are free there and " + std::to_string(needed >> 10) +
                 " kB are needed");
  return "";
}

}  // namespace frontier_surfels
