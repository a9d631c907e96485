/// The header of a PCD file: which fields a point has, where they lie, and how the points are stored.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace frontier_surfels {

struct PcdField {
  std::string name;
  char type;           ///< F, I or U
  std::size_t size;    ///< [byte] of one number: 1, 2, 4 or 8
  std::size_t count;   ///< numbers
  std::size_t offset;  ///< [byte] in the point
};

struct PcdHeader {
  std::vector<PcdField> fields;
  std::size_t point_bytes = 0;  ///< of all fields
  std::uint64_t points = 0;
  bool ascii = false;                ///< otherwise binary
  std::size_t bytes = 0;             ///< of the header itself, its last line included
  std::optional<std::uint32_t> crc;  ///< checksum of everything after the comment that holds it; empty if the file has no such comment
  std::size_t checked_from = 0;      ///< [byte] where that begins

  /// Null if there is none of this name.
  const PcdField* find(const std::string& name) const;
};

/// The first two lines of our own files.
std::string pcd_first_lines(std::uint32_t crc);

/// @param start  the first bytes of a file, as many as a header may have
/// @throws FileError  there is no whole header, or one that makes no sense, or the points are compressed. @param path  for the sentence
PcdHeader parse_pcd_header(const std::string& start, const std::string& path);

}  // namespace frontier_surfels
