#include "frontier_surfels/pcd.hpp"

#include <algorithm>
#include <cstring>
#include <locale>
#include <sstream>

#include "frontier_surfels/cloud_color.hpp"
#include "map/pcd_header.hpp"
#include "map/surfel_file.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kLongestHeader = 8192;  // [byte]

/// One point as it stands in our files. No field lies in a gap of a PCL type: PCL would copy it into the point's fourth coordinate.
struct Record {
  float x, y, z, normal_x, normal_y, normal_z;
  std::uint32_t rgb;
  float radius, confidence, curvature;
  std::uint32_t label, id;
};
static_assert(sizeof(Record) == 48);

/// The header behind its first lines.
std::string rest_of_header(std::size_t count) {
  const std::string points = std::to_string(count);
  return "VERSION 0.7\nFIELDS x y z normal_x normal_y normal_z rgb radius confidence curvature label id\n"
         "SIZE 4 4 4 4 4 4 4 4 4 4 4 4\nTYPE F F F F F F F F F F U U\nCOUNT 1 1 1 1 1 1 1 1 1 1 1 1\nWIDTH " +
         points + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + points + "\nDATA binary\n";
}

Record to_record(const Surfel& s) {
  const auto &p = s.position, &n = s.normal;
  const float confidence = s.label == Label::kFrontier ? 1.f : 0.f;
  return {p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), to_cloud_color(s), s.radius, confidence, 0, static_cast<std::uint32_t>(s.label), s.id};
}

/// Where a surfel's values lie in a point of a file.
struct Places {
  const PcdField* floats[7];  ///< position, normal, radius
  const PcdField* color;      ///< null: none
  const PcdField* label;      ///< null: confidence tells
  const PcdField* confidence;
};

/// A field of one number of 4 bytes. @param type  F, or ? for any
const PcdField* find_word(const PcdHeader& header, const char* name, char type, const std::string& path) {
  const PcdField* field = header.find(name);
  if (field != nullptr && (field->size != 4 || field->count != 1 || (type != '?' && field->type != type)))
    throw FileError(path + " has a field " + name + " of another type than a saved map: give another file.");
  return field;
}

Places find_places(const PcdHeader& header, const std::string& path) {
  Places places = {};
  std::size_t n = 0;
  for (const char* name : {"x", "y", "z", "normal_x", "normal_y", "normal_z", "radius"}) {
    places.floats[n] = find_word(header, name, 'F', path);
    if (places.floats[n++] == nullptr)
      throw FileError(path + " has no field " + name + ", which surfels need: give a file that was saved as surfels.");
  }
  places.color = find_word(header, header.find("rgb") != nullptr ? "rgb" : "rgba", '?', path);
  places.label = header.find("label");
  places.confidence = find_word(header, "confidence", 'F', path);
  if (places.label != nullptr && (places.label->type == 'F' || places.label->count != 1 || places.label->size > 4))
    throw FileError(path + " has a field label of another type than a saved map: give another file.");
  if (places.label == nullptr && places.confidence == nullptr)
    throw FileError(path + " has neither a field label nor confidence, so which surfels are frontier is unknown: give another file.");
  return places;
}

template <typename Number>
Number read_number(const std::uint8_t* point, const PcdField& field) {
  Number number = 0;
  std::memcpy(&number, point + field.offset, std::min(field.size, sizeof number));  // little endian: short numbers are filled up with 0
  return number;
}

Surfel to_surfel(const std::uint8_t* point, const Places& places, std::uint32_t id) {
  const auto value = [&](std::size_t n) { return read_number<float>(point, *places.floats[n]); };
  Surfel s;
  s.position = {value(0), value(1), value(2)};
  s.normal = {value(3), value(4), value(5)};
  s.radius = value(6);
  if (places.label != nullptr) {
    const auto label = read_number<std::uint32_t>(point, *places.label);
    s.label = static_cast<Label>(std::min<std::uint32_t>(label, 255));  // unknown ones are refused later
  } else {
    s.label = read_number<float>(point, *places.confidence) > 0.5f ? Label::kFrontier : Label::kOccupied;
  }
  if (places.color != nullptr) s.rgb = from_cloud_color(read_number<std::uint32_t>(point, *places.color));
  s.id = id;
  return s;
}

/// Reads a number of a text as the binary format stores it. @return whether there was one
template <typename Number>
bool parse(std::istream& words, std::uint8_t* place) {
  Number number = 0;
  if (!(words >> number)) return false;
  std::memcpy(place, &number, sizeof number);
  return true;
}

bool parse_field(std::istream& words, const PcdField& field, std::uint8_t* place) {
  if (field.type == 'F') return field.size == 4 ? parse<float>(words, place) : parse<double>(words, place);
  if (field.size == 8) return field.type == 'U' ? parse<std::uint64_t>(words, place) : parse<std::int64_t>(words, place);
  std::int64_t number = 0;  // not of the field's own size: streams take a byte for a letter
  if (!(words >> number)) return false;
  std::memcpy(place, &number, field.size);
  return true;
}

/// The points of an ascii file, one a line, as a binary file has them.
std::vector<std::uint8_t> to_binary(const std::vector<std::uint8_t>& text, const PcdHeader& header, const std::string& path) {
  std::vector<std::uint8_t> points, point(header.point_bytes);
  std::istringstream lines(std::string(text.begin(), text.end())), words;
  words.imbue(std::locale::classic());  // a number's point is a point in every country
  for (std::string line; std::getline(lines, line);) {
    words.clear();
    words.str(line);
    if ((words >> std::ws).eof()) continue;
    for (const PcdField& field : header.fields) {
      for (std::size_t n = 0; n < field.count; ++n) {
        if (!parse_field(words, field, &point[field.offset + n * field.size]))
          throw FileError(path + " is damaged: its point " + std::to_string(points.size() / header.point_bytes) + " has a value of field " +
                          field.name + " that is no finite number; use another copy.");
      }
    }
    points.insert(points.end(), point.begin(), point.end());
  }
  return points;
}

/// PCL leaves some bytes behind the points of a binary file; our own files end with them.
void check_size(const PcdHeader& header, std::uint64_t body_bytes, const std::string& path) {
  const std::uint64_t expected = header.points * header.point_bytes;
  if (body_bytes == expected || (body_bytes > expected && !header.ascii && !header.crc)) return;
  throw FileError(path + " is cut off or too long: its header promises " + std::to_string(header.points) +
                  " surfels, which its size does not fit.");
}

}  // namespace

void write_pcd(const std::string& path, const std::vector<Surfel>& surfels) {
  check_written(path, surfels);
  std::vector<Record> records(surfels.size());
  std::transform(surfels.begin(), surfels.end(), records.begin(), to_record);
  const std::size_t bytes = records.size() * sizeof(Record);
  const std::string rest = rest_of_header(records.size());
  const std::uint32_t crc = checksum(records.data(), bytes, checksum(rest.data(), rest.size()));
  replace_file(path, pcd_first_lines(crc) + rest, records.data(), bytes);
}

std::vector<Surfel> read_pcd(const std::string& path) {
  SurfelFile file(path);
  const std::string start = file.start(kLongestHeader);
  const PcdHeader header = parse_pcd_header(start, path);
  if (!header.ascii) check_size(header, file.body_bytes(header.bytes), path);
  std::vector<std::uint8_t> body = file.body(header.bytes);
  if (header.crc) {
    const std::uint32_t crc = checksum(&start[header.checked_from], header.bytes - header.checked_from);
    if (checksum(body.data(), body.size(), crc) != *header.crc)
      throw FileError(path + " is damaged: its checksum does not fit its surfels; use another copy.");
  }
  const Places places = find_places(header, path);
  if (header.ascii) {
    body = to_binary(body, header, path);
    check_size(header, body.size(), path);
  }

  std::vector<Surfel> surfels(header.points);
  for (std::size_t n = 0; n < surfels.size(); ++n)
    surfels[n] = to_surfel(&body[n * header.point_bytes], places, static_cast<std::uint32_t>(n));
  check_read(path, surfels);
  return surfels;
}

}  // namespace frontier_surfels
