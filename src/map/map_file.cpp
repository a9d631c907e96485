#include "frontier_surfels/map_file.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "frontier_surfels/pcd.hpp"
#include "frontier_surfels/ply.hpp"

namespace frontier_surfels {
namespace {

enum class Format { kPly, kPcd };

Format format_of(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending == ".ply") return Format::kPly;
  if (ending == ".pcd") return Format::kPcd;
  throw FileError("The path '" + path + "' of a map must end in .ply or .pcd: give one that does.");
}

}  // namespace

void write_map(const std::string& path, const std::vector<Surfel>& surfels) {
  format_of(path) == Format::kPly ? write_ply(path, surfels) : write_pcd(path, surfels);
}

void write_map(const std::string& path, const SavedMap& map) {
  format_of(path) == Format::kPly ? write_ply(path, map) : write_pcd(path, map.surfels);
}

SavedMap read_saved_map(const std::string& path) {
  if (format_of(path) == Format::kPly) return read_saved_ply(path);
  return {read_pcd(path), {}, {}};
}

std::vector<Surfel> read_map(const std::string& path) { return read_saved_map(path).surfels; }

}  // namespace frontier_surfels
