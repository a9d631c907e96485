#include "frontier_surfels/ply.hpp"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstring>

#include "map/surfel_file.hpp"

namespace frontier_surfels {
namespace {

/// One vertex as it stands in the file.
struct Record {
  float x, y, z, nx, ny, nz, radius;
  std::uint8_t red, green, blue, label;
};
static_assert(sizeof(Record) == 32);

constexpr std::size_t kLongestHeader = 1024;  // [byte]
constexpr char kHeaderEnd[] = "end_header\n";

std::string header(std::uint32_t crc, std::uint64_t count) {
  char start[160];
  std::snprintf(start, sizeof start,
                "ply\nformat binary_little_endian 1.0\ncomment frontier_surfels 1 crc32 %08" PRIx32 "\nelement vertex %" PRIu64 "\n", crc,
                count);
  std::string text = start;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "radius"}) text += std::string("property float ") + name + "\n";
  for (const char* name : {"red", "green", "blue", "label"}) text += std::string("property uchar ") + name + "\n";
  return text + kHeaderEnd;
}

Record to_record(const Surfel& s) {
  return {s.position.x(),
          s.position.y(),
          s.position.z(),
          s.normal.x(),
          s.normal.y(),
          s.normal.z(),
          s.radius,
          s.rgb[0],
          s.rgb[1],
          s.rgb[2],
          static_cast<std::uint8_t>(s.label)};
}

Surfel to_surfel(const std::uint8_t* bytes, std::uint32_t id) {
  Record r;
  std::memcpy(&r, bytes, sizeof r);
  return {{r.x, r.y, r.z}, {r.nx, r.ny, r.nz}, r.radius, static_cast<Label>(r.label), {r.red, r.green, r.blue}, id};
}

/// The header of a file, up to and with its last line.
std::string read_header(SurfelFile& file, const std::string& path) {
  const std::string text = file.start(kLongestHeader);
  const std::size_t end = text.find(kHeaderEnd);
  if (end == std::string::npos) throw FileError(path + " is no saved map, or is cut off in its header: give another file.");
  return text.substr(0, end + std::strlen(kHeaderEnd));
}

}  // namespace

void write_ply(const std::string& path, const std::vector<Surfel>& surfels) {
  check_written(path, surfels);
  std::vector<Record> records(surfels.size());
  std::transform(surfels.begin(), surfels.end(), records.begin(), to_record);
  const std::size_t bytes = records.size() * sizeof(Record);
  replace_file(path, header(checksum(records.data(), bytes), records.size()), records.data(), bytes);
}

std::vector<Surfel> read_ply(const std::string& path) {
  SurfelFile file(path);
  const std::string text = read_header(file, path);
  std::uint32_t crc = 0;
  std::uint64_t count = 0;
  std::sscanf(text.c_str(), "ply format binary_little_endian 1.0 comment frontier_surfels 1 crc32 %8" SCNx32 " element vertex %" SCNu64,
              &crc, &count);
  if (text != header(crc, count)) {  // whatever sscanf made of it
    throw FileError(path + " is a PLY file of another layout than a saved map: give a file that was saved by this library.");
  }

  const std::uint64_t size = file.body_bytes(text.size());
  if (size % sizeof(Record) != 0 || size / sizeof(Record) != count) {
    throw FileError(path + " is cut off or too long: its header promises " + std::to_string(count) +
                    " surfels, which its size does not fit.");
  }
  const std::vector<std::uint8_t> body = file.body(text.size());
  if (checksum(body.data(), body.size()) != crc)
    throw FileError(path + " is damaged: its checksum does not fit its surfels; use another copy.");

  std::vector<Surfel> surfels(count);
  for (std::size_t n = 0; n < surfels.size(); ++n) surfels[n] = to_surfel(&body[n * sizeof(Record)], static_cast<std::uint32_t>(n));
  check_read(path, surfels);
  return surfels;
}

}  // namespace frontier_surfels
