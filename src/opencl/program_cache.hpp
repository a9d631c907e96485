/// Built programs, kept as files: building the kernels takes some drivers many seconds. Nothing that happens to the folder or its files is
/// an error: a program that cannot be read is built again, and one that cannot be written is not kept.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace frontier_surfels {

struct StoredProgram {
  std::vector<std::string> kernels;  ///< names of all kernels, sorted
  std::string binary;                ///< the driver's
};

/// FRONTIER_SURFELS_CACHE_DIR, else XDG_CACHE_HOME/frontier_surfels, else HOME/.cache/frontier_surfels; "" without any of these.
std::filesystem::path program_cache_folder();

/// The file of a program in a folder.
/// @param identity  all that the program depends on: device, driver, options, source
std::filesystem::path program_file(const std::filesystem::path& folder, const std::string& identity);

/// @return nothing if there is no file of this identity, or it is damaged
std::optional<StoredProgram> read_program(const std::filesystem::path& folder, const std::string& identity);

/// Replaces the file in one step, so that another process sees the old one or the new one. @return whether that succeeded
bool write_program(const std::filesystem::path& folder, const std::string& identity, const StoredProgram& program);

}  // namespace frontier_surfels
