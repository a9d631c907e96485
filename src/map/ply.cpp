#include "frontier_surfels/ply.hpp"

#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

namespace frontier_surfels {
namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "records are written as they lie in memory");

/// One vertex as it stands in the file.
struct Record {
  float x, y, z, nx, ny, nz, radius;
  std::uint8_t red, green, blue, label;
};
static_assert(sizeof(Record) == 32);

constexpr std::size_t kLongestHeader = 1024;
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

std::uint32_t checksum(const std::vector<Record>& records) {
  return static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(records.data()), records.size() * sizeof(Record)));
}

/// Whether a record can be a surfel: all numbers finite, a radius, one of the labels.
bool sound(const Record& r) {
  const float numbers[] = {r.x, r.y, r.z, r.nx, r.ny, r.nz, r.radius};
  return std::all_of(std::begin(numbers), std::end(numbers), [](float f) { return std::isfinite(f); }) && r.radius > 0 && r.label <= 1;
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

Surfel to_surfel(const Record& r, std::uint32_t id) {
  return {{r.x, r.y, r.z}, {r.nx, r.ny, r.nz}, r.radius, static_cast<Label>(r.label), {r.red, r.green, r.blue}, id};
}

struct Close {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Close>;

/// A new file that takes the place of `path` at commit(); without commit() it leaves no trace.
class Replacement {
 public:
  explicit Replacement(const std::string& path) : path_(path) {
    static std::atomic<unsigned> counter{0};  // several threads may save at once
    do {
      temporary_ = path + ".tmp-" + std::to_string(getpid()) + "-" + std::to_string(counter++);
      file_.reset(std::fopen(temporary_.c_str(), "wbxe"));  // x: never into a file that is there already
    } while (!file_ && errno == EEXIST);
    if (!file_) fail();
  }
  Replacement(const Replacement&) = delete;
  Replacement& operator=(const Replacement&) = delete;
  ~Replacement() {
    if (!temporary_.empty()) std::remove(temporary_.c_str());
  }

  void write(const void* data, std::size_t bytes) {
    if (bytes > 0 && std::fwrite(data, 1, bytes, file_.get()) != bytes) fail();  // an empty map's data may be null
  }

  void commit() {
    if (std::fflush(file_.get()) != 0 || fsync(fileno(file_.get())) != 0) fail();
    if (std::fclose(file_.release()) != 0) fail();
    if (std::rename(temporary_.c_str(), path_.c_str()) != 0) fail();
    temporary_.clear();
  }

 private:
  [[noreturn]] void fail() const { throw FileError("The map cannot be written to " + path_ + ": " + std::strerror(errno) + "."); }

  std::string path_, temporary_;
  File file_;
};

/// The header of an open file, up to and with its last line.
std::string read_header(std::FILE* file, const std::string& path) {
  std::string text(kLongestHeader, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), file));
  if (std::ferror(file)) throw FileError("The map " + path + " cannot be read: " + std::strerror(errno) + ".");
  const std::size_t end = text.find(kHeaderEnd);
  if (end == std::string::npos) throw FileError(path + " is no saved map, or is cut off in its header: give another file.");
  return text.substr(0, end + std::strlen(kHeaderEnd));
}

}  // namespace

void write_ply(const std::string& path, const std::vector<Surfel>& surfels) {
  namespace fs = std::filesystem;
  std::error_code none;
  // A link is followed, and a device (/dev/null) is not replaced by a file.
  const fs::path target = fs::exists(path, none) ? fs::canonical(path, none) : fs::path(path);
  if (fs::exists(target, none) && !fs::is_regular_file(target, none)) {
    throw FileError("The map cannot be written to " + path + ": it is no ordinary file; give another name.");
  }

  std::vector<Record> records(surfels.size());
  std::transform(surfels.begin(), surfels.end(), records.begin(), to_record);
  const auto unsound = std::find_if_not(records.begin(), records.end(), sound);
  if (unsound != records.end()) {
    throw FileError("The map cannot be written to " + path + ": surfel " + std::to_string(unsound - records.begin()) +
                    " has a value that is not finite, or no radius.");
  }

  const std::string text = header(checksum(records), records.size());
  Replacement file(target.string());
  file.write(text.data(), text.size());
  file.write(records.data(), records.size() * sizeof(Record));
  file.commit();
}

std::vector<Surfel> read_ply(const std::string& path) {
  const File file(std::fopen(path.c_str(), "rbe"));
  if (!file) throw FileError("The map " + path + " cannot be read: " + std::strerror(errno) + ".");
  const std::string text = read_header(file.get(), path);

  std::uint32_t crc = 0;
  std::uint64_t count = 0;
  std::sscanf(text.c_str(), "ply format binary_little_endian 1.0 comment frontier_surfels 1 crc32 %8" SCNx32 " element vertex %" SCNu64,
              &crc, &count);
  if (text != header(crc, count)) {  // whatever sscanf made of it
    throw FileError(path + " is a PLY file of another layout than a saved map: give a file that was saved by this library.");
  }

  // The file's true size first: a damaged count must not make us ask for its memory.
  std::error_code none;
  const std::uint64_t body = std::filesystem::file_size(path, none) - text.size();
  if (none || body % sizeof(Record) != 0 || body / sizeof(Record) != count) {
    throw FileError(path + " is cut off or too long: its header promises " + std::to_string(count) +
                    " surfels, which its size does not fit.");
  }
  std::vector<Record> records(count);
  if (count > 0 && (std::fseek(file.get(), static_cast<long>(text.size()), SEEK_SET) != 0 ||
                    std::fread(records.data(), sizeof(Record), count, file.get()) != count)) {
    throw FileError("The map " + path + " cannot be read to its end: use another copy.");
  }
  if (checksum(records) != crc) throw FileError(path + " is damaged: its checksum does not fit its surfels; use another copy.");
  if (!std::all_of(records.begin(), records.end(), sound)) {
    throw FileError(path + " holds a surfel with a value that is not finite, without radius, or with an unknown label.");
  }

  std::vector<Surfel> surfels(count);
  std::transform(records.begin(), records.end(), surfels.begin(),
                 [id = std::uint32_t{0}](const Record& record) mutable { return to_surfel(record, id++); });
  return surfels;
}

}  // namespace frontier_surfels
