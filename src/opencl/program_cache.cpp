#include "opencl/program_cache.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <system_error>

#include "opencl/cache_folder.hpp"

namespace frontier_surfels {
namespace {

namespace fs = std::filesystem;

constexpr char kMagic[8] = {'F', 'S', 'P', 'R', 'O', 'G', '0', '1'};

/// Begins a file. Behind it are the identity, the names of the kernels with a line feed behind each, and the binary.
struct Header {
  char magic[8];
  std::uint64_t identity_bytes, names_bytes, binary_bytes;
  std::uint64_t checksum;  ///< CRC-32 of what is behind the header
};

std::uint64_t checksum(const std::string& text) {
  return crc32_z(crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(text.data()), text.size());
}

/// FNV-1a. The identity is also in the file, so that two with the same hash take turns and are not confused.
std::string hash(const std::string& text) {
  std::uint64_t value = 14695981039346656037u;
  for (const unsigned char c : text) value = (value ^ c) * 1099511628211u;
  std::string digits;
  for (int shift = 60; shift >= 0; shift -= 4) digits += "0123456789abcdef"[value >> shift & 15];
  return digits;
}

/// The contents of a regular file; "" if it cannot be read. A pipe or a device of that name must not block.
std::string contents(const fs::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return "";
  struct stat about = {};
  std::string text;
  if (fstat(file, &about) == 0 && S_ISREG(about.st_mode) && about.st_size < (std::int64_t{1} << 30)) {
    text.resize(static_cast<std::size_t>(about.st_size));
    std::size_t done = 0;
    while (done < text.size()) {
      const ssize_t count = read(file, text.data() + done, text.size() - done);
      if (count <= 0) break;
      done += static_cast<std::size_t>(count);
    }
    text.resize(done);
  }
  close(file);
  return text;
}

bool write_all(int file, const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t count = write(file, text.data() + done, text.size() - done);
    if (count <= 0) return false;
    done += static_cast<std::size_t>(count);
  }
  return true;
}

}  // namespace

fs::path program_cache_folder() { return cache_folder("FRONTIER_SURFELS_CACHE_DIR", "frontier_surfels"); }

fs::path program_file(const fs::path& folder, const std::string& identity) { return folder / (hash(identity) + ".program"); }

std::optional<StoredProgram> read_program(const fs::path& folder, const std::string& identity) {
  if (folder.empty()) return std::nullopt;
  const std::string text = contents(program_file(folder, identity));
  Header header;
  if (text.size() < sizeof(header)) return std::nullopt;
  std::memcpy(&header, text.data(), sizeof(header));
  const std::string body = text.substr(sizeof(header));
  if (std::memcmp(header.magic, kMagic, sizeof(kMagic)) != 0 || header.identity_bytes != identity.size()) return std::nullopt;
  // One after the other, so that no sum of damaged lengths overflows.
  if (header.names_bytes > body.size() || header.binary_bytes > body.size()) return std::nullopt;
  if (header.identity_bytes + header.names_bytes + header.binary_bytes != body.size()) return std::nullopt;
  if (header.checksum != checksum(body) || body.compare(0, identity.size(), identity) != 0) return std::nullopt;
  StoredProgram program;
  const std::size_t end = identity.size() + header.names_bytes;
  for (std::size_t at = identity.size(), feed = 0; at < end; at = feed + 1) {
    feed = body.find('\n', at);
    if (feed >= end) return std::nullopt;
    program.kernels.push_back(body.substr(at, feed - at));
  }
  program.binary = body.substr(end);
  return program;
}

bool write_program(const fs::path& folder, const std::string& identity, const StoredProgram& program) {
  if (folder.empty()) return false;
  std::string names;
  for (const std::string& name : program.kernels) names += name + "\n";
  const std::string body = identity + names + program.binary;
  Header header = {{}, identity.size(), names.size(), program.binary.size(), checksum(body)};
  std::memcpy(header.magic, kMagic, sizeof(kMagic));

  std::error_code ignored;
  fs::create_directories(folder, ignored);
  std::string unfinished = (folder / "unfinished_XXXXXX").string();
  const int file = mkstemp(unfinished.data());
  if (file < 0) return false;
  const bool written = write_all(file, std::string(reinterpret_cast<const char*>(&header), sizeof(header)) + body);
  const bool closed = close(file) == 0;
  if (written && closed && std::rename(unfinished.c_str(), program_file(folder, identity).c_str()) == 0) return true;
  unlink(unfinished.c_str());
  return false;
}

}  // namespace frontier_surfels
