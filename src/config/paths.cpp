#include "frontier_surfels/paths.hpp"

#include <pwd.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace frontier_surfels {
namespace {

/// The user's home folder; empty if there is none.
std::string home() {
  const char* named = std::getenv("HOME");
  if (named != nullptr && *named != '\0') return named;
  const passwd* account = getpwuid(getuid());
  return account != nullptr && account->pw_dir != nullptr ? account->pw_dir : "";
}

}  // namespace

std::string absolute_path(const std::string& path) {
  if (path.empty()) return path;
  std::string whole = path;
  if (const std::string folder = home(); !folder.empty() && (path == "~" || path.rfind("~/", 0) == 0)) whole = folder + path.substr(1);
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(whole, error);  // fails if the current folder has been deleted
  return error ? whole : absolute.lexically_normal().string();
}

}  // namespace frontier_surfels
