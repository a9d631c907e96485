#include "frontier_surfels/ply.hpp"

#include <algorithm>
#include <charconv>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "map/surfel_file.hpp"
#include "map/view_packing.hpp"

namespace frontier_surfels {
namespace {

/// One vertex as it stands in the file.
struct Record {
  float x, y, z, nx, ny, nz, radius;
  std::uint8_t red, green, blue, label;
};
static_assert(sizeof(Record) == 32);

constexpr std::size_t kLongestHeader = 2048;  // [byte]
constexpr char kHeaderEnd[] = "end_header\n";

/// The shortest text that gives the same number, whatever the locale.
std::string text_of(double value) {
  char text[40];
  return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
}

/// What a header says of the body.
struct Sizes {
  std::uint32_t crc = 0;
  std::uint64_t surfels = 0;
  double block_size = 0;  ///< of what has been seen [m]
  int points = 0;         ///< of it, along a block's edge
  std::uint64_t blocks = 0;
  std::uint64_t views = 0;
  std::uint64_t bytes = 0;  ///< of blocks and views
};

std::string header(const Sizes& sizes) {
  char line[160];
  std::snprintf(line, sizeof line, "ply\nformat binary_little_endian 1.0\ncomment frontier_surfels 1 crc32 %08" PRIx32 "\n", sizes.crc);
  std::string text = line;
  if (sizes.bytes > 0 || sizes.points > 0)
    text += "comment seen " + std::to_string(sizes.points) + " points " + text_of(sizes.block_size) + " m " + std::to_string(sizes.blocks) +
            " blocks " + std::to_string(sizes.views) + " views\n";
  text += "element vertex " + std::to_string(sizes.surfels) + "\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "radius"}) text += std::string("property float ") + name + "\n";
  for (const char* name : {"red", "green", "blue", "label"}) text += std::string("property uchar ") + name + "\n";
  // Bytes one by one, because MeshLab loses its place in an element that has lists.
  if (sizes.bytes > 0 || sizes.points > 0) text += "element seen " + std::to_string(sizes.bytes) + "\nproperty uchar byte\n";
  return text + kHeaderEnd;
}

/// Reads what header() has written: anything else gives other sizes, whose header is another one.
Sizes sizes_of(const std::string& header) {
  Sizes sizes;
  const auto after = [&](const char* words) {
    const std::size_t at = header.find(words);
    return at == std::string::npos ? "" : header.c_str() + at + std::strlen(words);
  };
  sizes.crc = static_cast<std::uint32_t>(std::strtoul(after("crc32 "), nullptr, 16));
  sizes.surfels = std::strtoull(after("element vertex "), nullptr, 10);
  sizes.bytes = std::strtoull(after("element seen "), nullptr, 10);
  sizes.points = static_cast<int>(std::strtoul(after("comment seen "), nullptr, 10));
  const char* size = after(" points ");
  std::from_chars(size, size + std::strlen(size), sizes.block_size);
  sizes.blocks = std::strtoull(after(" m "), nullptr, 10);
  sizes.views = std::strtoull(after(" blocks "), nullptr, 10);
  return sizes;
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

FileError cut_off(const std::string& path, const Sizes& sizes) {
  return FileError(path + " is cut off or too long: its header promises " + std::to_string(sizes.surfels) +
                   " surfels, which its size does not fit.");
}

void append(std::vector<std::uint8_t>& body, const void* data, std::size_t bytes) {
  body.insert(body.end(), static_cast<const std::uint8_t*>(data), static_cast<const std::uint8_t*>(data) + bytes);
}

/// A list: its size, and then its elements.
template <typename T>
void append_list(std::vector<std::uint8_t>& body, const std::vector<T>& values) {
  const auto size = static_cast<std::uint32_t>(values.size());
  append(body, &size, sizeof size);
  append(body, values.data(), values.size() * sizeof(T));
}

void append_block(std::vector<std::uint8_t>& body, const SeenSpace::Block& block) {
  append(body, block.block.data(), sizeof block.block);
  append_list(body, block.bytes);
}

/// Reads a body piece by piece. @throws FileError  it ends too early
class Pieces {
 public:
  Pieces(const std::vector<std::uint8_t>& body, std::size_t at, const std::string& path, const Sizes& sizes)
      : body_(body), at_(at), path_(path), sizes_(sizes) {}

  void take(void* to, std::size_t bytes) {
    if (body_.size() - at_ < bytes) throw cut_off(path_, sizes_);
    if (bytes > 0) std::memcpy(to, &body_[at_], bytes);
    at_ += bytes;
  }

  template <typename T>
  std::vector<T> take_list() {
    std::uint32_t size = 0;
    take(&size, sizeof size);
    if ((body_.size() - at_) / sizeof(T) < size) throw cut_off(path_, sizes_);
    std::vector<T> values(size);
    take(values.data(), size * sizeof(T));
    return values;
  }

  SeenSpace::Block take_block() {
    SeenSpace::Block block;
    take(block.block.data(), sizeof block.block);
    block.bytes = take_list<std::uint8_t>();
    return block;
  }

  SavedView take_view() {
    std::size_t used = 0;
    const SavedView view = unpack_view(body_.data() + at_, body_.size() - at_, &used);
    at_ += used;
    return view;
  }

  bool at_end() const { return at_ == body_.size(); }

 private:
  const std::vector<std::uint8_t>& body_;
  std::size_t at_;
  const std::string& path_;
  const Sizes& sizes_;
};

/// The header of a file, up to and with its last line.
std::string read_header(SurfelFile& file, const std::string& path) {
  const std::string text = file.start(kLongestHeader);
  const std::size_t end = text.find(kHeaderEnd);
  if (end == std::string::npos) throw FileError(path + " is no saved map, or is cut off in its header: give another file.");
  return text.substr(0, end + std::strlen(kHeaderEnd));
}

}  // namespace

void write_ply(const std::string& path, const std::vector<Surfel>& surfels) { write_ply(path, SavedMap{surfels, {}, {}}); }

void write_ply(const std::string& path, const SavedMap& map) {
  check_written(path, map.surfels);
  std::vector<std::uint8_t> body;
  for (const Surfel& surfel : map.surfels) {
    const Record record = to_record(surfel);
    append(body, &record, sizeof record);
  }
  for (const SeenSpace::Block& block : map.seen.blocks) append_block(body, block);
  for (const SavedView& view : map.views) {
    const std::vector<std::uint8_t> bytes = pack_view(view);
    append(body, bytes.data(), bytes.size());
  }
  const Sizes sizes = {checksum(body.data(), body.size()),
                       map.surfels.size(),
                       map.seen.block_size,
                       map.seen.points,
                       map.seen.blocks.size(),
                       map.views.size(),
                       body.size() - map.surfels.size() * sizeof(Record)};
  replace_file(path, header(sizes), body.data(), body.size());
}

std::vector<Surfel> read_ply(const std::string& path) { return read_saved_ply(path).surfels; }

SavedMap read_saved_ply(const std::string& path) {
  SurfelFile file(path);
  const std::string text = read_header(file, path);
  const Sizes sizes = sizes_of(text);
  if (text != header(sizes))
    throw FileError(path + " is a PLY file of another layout than a saved map: give a file that was saved by this library.");
  const std::uint64_t size = file.body_bytes(text.size()), of_surfels = sizes.surfels * sizeof(Record);
  const bool fits = size / sizeof(Record) >= sizes.surfels && size - of_surfels == sizes.bytes;
  if (!fits) throw cut_off(path, sizes);
  const std::vector<std::uint8_t> body = file.body(text.size());
  if (checksum(body.data(), body.size()) != sizes.crc)
    throw FileError(path + " is damaged: its checksum does not fit its contents; use another copy.");

  SavedMap map;
  map.surfels.resize(sizes.surfels);
  for (std::size_t n = 0; n < map.surfels.size(); ++n) map.surfels[n] = to_surfel(&body[n * sizeof(Record)], static_cast<std::uint32_t>(n));
  check_read(path, map.surfels);
  map.seen = {sizes.block_size, sizes.points, {}};
  Pieces pieces(body, of_surfels, path, sizes);
  for (std::uint64_t n = 0; n < sizes.blocks; ++n) map.seen.blocks.push_back(pieces.take_block());
  for (std::uint64_t n = 0; n < sizes.views; ++n) map.views.push_back(pieces.take_view());
  if (!pieces.at_end()) throw cut_off(path, sizes);
  return map;
}

}  // namespace frontier_surfels
