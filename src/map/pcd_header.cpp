#include "map/pcd_header.hpp"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <map>
#include <sstream>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {
namespace {

constexpr std::uint64_t kMostPointBytes = 1 << 16;  // more is damage, and must not overflow what is computed from it

/// The words of each line by its first word. Comments are left out. @param bytes  gets the length of all lines up to and with DATA
std::map<std::string, std::vector<std::string>> read_lines(const std::string& start, std::size_t& bytes) {
  std::map<std::string, std::vector<std::string>> lines;
  for (std::size_t begin = 0, end; (end = start.find('\n', begin)) != std::string::npos; begin = end + 1) {
    std::istringstream words(start.substr(begin, end - begin));
    std::string first, word;
    words >> first;
    if (first.empty() || first[0] == '#') continue;
    std::vector<std::string>& line = lines[first];
    line.clear();
    while (words >> word) line.push_back(word);
    if (first != "DATA") continue;
    bytes = end + 1;
    return lines;
  }
  return {};
}

/// A whole number below 2^53, or nothing.
std::optional<std::uint64_t> to_number(const std::string& word) {
  if (word.empty() || word.size() > 15 || !std::all_of(word.begin(), word.end(), [](unsigned char c) { return c >= '0' && c <= '9'; }))
    return {};
  return std::stoull(word);
}

/// @return whether the header's lists of fields make sense
bool read_fields(std::map<std::string, std::vector<std::string>>& lines, PcdHeader& header) {
  const auto &names = lines["FIELDS"], &sizes = lines["SIZE"], &types = lines["TYPE"];
  const auto& counts = lines.count("COUNT") > 0 ? lines["COUNT"] : std::vector<std::string>(names.size(), "1");
  if (names.empty() || sizes.size() != names.size() || types.size() != names.size() || counts.size() != names.size()) return false;
  std::uint64_t offset = 0;
  for (std::size_t n = 0; n < names.size(); ++n) {
    const auto size = to_number(sizes[n]), count = to_number(counts[n]);
    const std::string& type = types[n];
    if (!size || !count || *count > kMostPointBytes || (*size != 1 && *size != 2 && *size != 4 && *size != 8)) return false;
    if (type != "I" && type != "U" && !(type == "F" && *size >= 4)) return false;
    header.fields.push_back({names[n], type[0], *size, *count, offset});
    offset += *size * *count;
    if (offset > kMostPointBytes) return false;
  }
  header.point_bytes = offset;
  return offset > 0;
}

/// @return whether the header's numbers of points agree
bool read_size(std::map<std::string, std::vector<std::string>>& lines, PcdHeader& header) {
  const auto number = [&](const char* name) { return lines[name].size() == 1 ? to_number(lines[name][0]) : std::nullopt; };
  const auto width = number("WIDTH"), height = number("HEIGHT");
  if (!width || !height || *width > UINT32_MAX || *height > UINT32_MAX || *width * *height > UINT32_MAX) return false;
  header.points = *width * *height;
  return lines.count("POINTS") == 0 || number("POINTS") == header.points;
}

void read_checksum(const std::string& start, PcdHeader& header) {
  std::uint32_t crc = 0;
  if (std::sscanf(start.c_str(), "# .PCD v0.7 - Point Cloud Data file format\n# frontier_surfels 1 crc32 %8" SCNx32, &crc) != 1) return;
  const std::string ours = pcd_first_lines(crc);
  if (start.compare(0, ours.size(), ours) != 0) return;
  header.crc = crc;
  header.checked_from = ours.size();
}

}  // namespace

const PcdField* PcdHeader::find(const std::string& name) const {
  const auto found = std::find_if(fields.begin(), fields.end(), [&](const PcdField& field) { return field.name == name; });
  return found == fields.end() ? nullptr : &*found;
}

std::string pcd_first_lines(std::uint32_t crc) {
  char text[120];
  std::snprintf(text, sizeof text, "# .PCD v0.7 - Point Cloud Data file format\n# frontier_surfels 1 crc32 %08" PRIx32 "\n", crc);
  return text;
}

PcdHeader parse_pcd_header(const std::string& start, const std::string& path) {
  PcdHeader header;
  auto lines = read_lines(start, header.bytes);
  const std::vector<std::string>& data = lines["DATA"];
  if (data.empty()) throw FileError(path + " is no PCD file, or is cut off in its header: give another file.");
  if (data[0] == "binary_compressed")
    throw FileError(path + " is compressed (DATA binary_compressed), which cannot be read: save it with DATA binary.");
  header.ascii = data[0] == "ascii";
  if ((!header.ascii && data[0] != "binary") || !read_fields(lines, header) || !read_size(lines, header))
    throw FileError(path + " has a PCD header that is damaged, or of an unknown version: give another file.");
  read_checksum(start, header);
  return header;
}

}  // namespace frontier_surfels
