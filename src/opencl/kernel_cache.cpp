#include "opencl/kernel_cache.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>

namespace frontier_surfels {
namespace {

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

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
  if (const std::string folder = variable("POCL_CACHE_DIR"); !folder.empty()) return std::filesystem::absolute(folder);
  if (const std::string caches = variable("XDG_CACHE_HOME"); !caches.empty()) return std::filesystem::path(caches) / "pocl/kcache";
  if (const std::string home = variable("HOME"); !home.empty()) return std::filesystem::path(home) / ".cache/pocl/kcache";
  return "/tmp/pocl/kcache";
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
