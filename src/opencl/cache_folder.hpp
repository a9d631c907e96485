/// Where programs keep what they can make again.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace frontier_surfels {

/// The folder that an environment variable names, else XDG_CACHE_HOME/`below`, else HOME/.cache/`below`; "" without any of these.
inline std::filesystem::path cache_folder(const char* own_variable, const char* below) {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value == nullptr ? "" : value);
  };
  if (const std::string folder = variable(own_variable); !folder.empty()) return std::filesystem::absolute(folder);
  if (const std::string caches = variable("XDG_CACHE_HOME"); !caches.empty()) return std::filesystem::path(caches) / below;
  if (const std::string home = variable("HOME"); !home.empty()) return std::filesystem::path(home) / ".cache" / below;
  return "";
}

}  // namespace frontier_surfels
