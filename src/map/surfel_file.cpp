#include "map/surfel_file.hpp"

#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

/// Why the last call failed, as the end of a sentence.
std::string reason() {
  if (errno == ENAMETOOLONG) return "a file system takes no name as long as that (most take 255 bytes); give a shorter one.";
  return std::string(std::strerror(errno)) + ".";
}

/// A new file that takes the place of `path` at commit(). Without commit() it leaves no trace.
class Replacement {
 public:
  explicit Replacement(const std::string& path) : path_(path) {
    static std::atomic<unsigned> counter{0};  // several threads may save at once
    do {
      // A name of its own, because the file's may be as long as names can be.
      const std::string name = ".frontier_surfels-" + std::to_string(getpid()) + "-" + std::to_string(counter++) + ".tmp";
      temporary_ = (fs::path(path).parent_path() / name).string();
      file_ = std::fopen(temporary_.c_str(), "wbxe");  // x: never into a file that is there already
    } while (file_ == nullptr && errno == EEXIST);
    if (file_ == nullptr) fail();
  }
  Replacement(const Replacement&) = delete;
  Replacement& operator=(const Replacement&) = delete;
  ~Replacement() {
    if (file_ != nullptr) std::fclose(file_);
    if (!temporary_.empty()) std::remove(temporary_.c_str());
  }

  void write(const void* data, std::size_t bytes) {
    if (bytes > 0 && std::fwrite(data, 1, bytes, file_) != bytes) fail();  // the data of an empty map may be null
  }

  void commit() {
    if (std::fflush(file_) != 0 || fsync(fileno(file_)) != 0) fail();
    if (std::fclose(std::exchange(file_, nullptr)) != 0) fail();
    if (std::rename(temporary_.c_str(), path_.c_str()) != 0) fail();
    temporary_.clear();
  }

 private:
  [[noreturn]] void fail() const { throw FileError("The map cannot be written to " + path_ + ": " + reason()); }

  std::string path_, temporary_;
  std::FILE* file_ = nullptr;
};

bool is_sound(const Surfel& s) {
  return s.position.allFinite() && s.normal.allFinite() && std::isfinite(s.radius) && s.radius > 0 &&
         (s.label == Label::kFrontier || s.label == Label::kOccupied);
}

FileError unreadable(const std::string& path) { return FileError("The map " + path + " cannot be read: " + reason()); }

}  // namespace

void replace_file(const std::string& path, const std::string& header, const void* body, std::size_t body_bytes) {
  std::error_code none;
  // A link is followed, and a device (/dev/null) is not replaced by a file.
  const fs::path target = fs::exists(path, none) ? fs::canonical(path, none) : fs::path(path);
  if (fs::exists(target, none) && !fs::is_regular_file(target, none))
    throw FileError("The map cannot be written to " + path + ": it is " +
                    (fs::is_directory(target, none) ? "a folder; give the name of a file." : "no ordinary file; give another name."));
  Replacement file(target.string());
  file.write(header.data(), header.size());
  file.write(body, body_bytes);
  file.commit();
}

SurfelFile::SurfelFile(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "rbe")) {
  if (!file_) throw unreadable(path);
}

std::string SurfelFile::start(std::size_t most) {
  std::string text(most, '\0');
  std::rewind(file_.get());
  text.resize(std::fread(text.data(), 1, text.size(), file_.get()));
  if (std::ferror(file_.get())) throw unreadable(path_);
  return text;
}

std::uint64_t SurfelFile::body_bytes(std::size_t header_bytes) const {
  std::error_code error;
  const std::uint64_t size = fs::file_size(path_, error);
  return error || size < header_bytes ? 0 : size - header_bytes;
}

std::vector<std::uint8_t> SurfelFile::body(std::size_t header_bytes) {
  std::vector<std::uint8_t> bytes(body_bytes(header_bytes));
  if (!bytes.empty() && (std::fseek(file_.get(), static_cast<long>(header_bytes), SEEK_SET) != 0 ||
                         std::fread(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()))
    throw FileError("The map " + path_ + " cannot be read to its end: use another copy.");
  return bytes;
}

std::uint32_t checksum(const void* data, std::size_t bytes, std::uint32_t crc) {
  return bytes == 0 ? crc : static_cast<std::uint32_t>(crc32_z(crc, static_cast<const Bytef*>(data), bytes));
}

void check_written(const std::string& path, const std::vector<Surfel>& surfels) {
  const auto unsound = std::find_if_not(surfels.begin(), surfels.end(), is_sound);
  if (unsound == surfels.end()) return;
  throw FileError("The map cannot be written to " + path + ": surfel " + std::to_string(unsound - surfels.begin()) +
                  " has a value that is not finite, or no radius.");
}

void check_read(const std::string& path, const std::vector<Surfel>& surfels) {
  if (!std::all_of(surfels.begin(), surfels.end(), is_sound))
    throw FileError(path + " holds a surfel with a value that is not finite, without radius, or with an unknown label.");
}

}  // namespace frontier_surfels
