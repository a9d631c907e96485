/// What the file formats of maps have in common: safe writing, careful reading, and the check of the surfels.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "records are written as they lie in memory");

/// Writes `header` and then `body` to a temporary file beside `path`, flushes it to the disk and renames it to `path`. An existing file is
/// replaced whole or not at all, and a link is followed. @throws FileError
void replace_file(const std::string& path, const std::string& header, const void* body, std::size_t body_bytes);

/// A file that is read from its start.
class SurfelFile {
 public:
  /// @throws FileError  it cannot be opened or read
  explicit SurfelFile(const std::string& path);

  /// The first bytes of the file, at most `most` of them.
  std::string start(std::size_t most);

  /// Everything behind the header of this size. @throws FileError
  std::vector<std::uint8_t> body(std::size_t header_bytes);

  /// Size of what is behind the header [byte], from the size of the file: a damaged header must not decide how much memory is taken.
  std::uint64_t body_bytes(std::size_t header_bytes) const;

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::string path_;
  std::unique_ptr<std::FILE, Close> file_;
};

/// CRC-32 of some bytes. @param crc  of the bytes before them
std::uint32_t checksum(const void* data, std::size_t bytes, std::uint32_t crc = 0);

/// @throws FileError  a surfel has a value that is not finite, or no radius
void check_written(const std::string& path, const std::vector<Surfel>& surfels);

/// @throws FileError  the same, or a surfel has an unknown label
void check_read(const std::string& path, const std::vector<Surfel>& surfels);

}  // namespace frontier_surfels
