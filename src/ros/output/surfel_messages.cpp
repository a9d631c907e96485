#include "ros/output/surfel_messages.hpp"

#include <boost/predef/other/endian.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <limits>
#include <string>

namespace frontier_surfels::messages {
namespace {

using sensor_msgs::PointCloud2;
using sensor_msgs::PointField;

constexpr bool kThisMachineIsBigEndian = BOOST_ENDIAN_BIG_BYTE;

/// A surfel as it lies in a cloud.
struct Point {
  float position[3], normal[3], radius;
  std::uint32_t rgb;  // 0x00rrggbb, PCL's packing
  std::uint32_t id;
  std::uint8_t label, padding[3];
};
static_assert(sizeof(Point) == 40, "points are copied as they lie in memory");

struct Field {
  const char* name;
  std::uint8_t type;
  std::size_t offset;  ///< [byte] in Point
};
constexpr std::array<Field, 10> kFields = {{{"x", PointField::FLOAT32, offsetof(Point, position)},
                                            {"y", PointField::FLOAT32, offsetof(Point, position) + 4},
                                            {"z", PointField::FLOAT32, offsetof(Point, position) + 8},
                                            {"normal_x", PointField::FLOAT32, offsetof(Point, normal)},
                                            {"normal_y", PointField::FLOAT32, offsetof(Point, normal) + 4},
                                            {"normal_z", PointField::FLOAT32, offsetof(Point, normal) + 8},
                                            {"radius", PointField::FLOAT32, offsetof(Point, radius)},
                                            {"rgb", PointField::FLOAT32, offsetof(Point, rgb)},
                                            {"id", PointField::UINT32, offsetof(Point, id)},
                                            {"label", PointField::UINT8, offsetof(Point, label)}}};

std::size_t bytes_of(const Field& field) { return field.type == PointField::UINT8 ? 1 : 4; }

Point to_point(const Surfel& s) {
  Point point = {};
  std::memcpy(point.position, s.position.data(), sizeof(point.position));
  std::memcpy(point.normal, s.normal.data(), sizeof(point.normal));
  point.radius = s.radius;
  point.rgb = static_cast<std::uint32_t>(s.rgb[0] << 16 | s.rgb[1] << 8 | s.rgb[2]);
  point.id = s.id;
  point.label = static_cast<std::uint8_t>(s.label);
  return point;
}

Surfel to_surfel(const Point& point) {
  if (point.label > 1) throw Error("The cloud is damaged: " + std::to_string(point.label) + " is no label (0 frontier, 1 occupied).");
  Surfel s;
  std::memcpy(s.position.data(), point.position, sizeof(point.position));
  std::memcpy(s.normal.data(), point.normal, sizeof(point.normal));
  s.radius = point.radius;
  for (int channel = 0; channel < 3; ++channel) s.rgb[channel] = static_cast<std::uint8_t>(point.rgb >> (16 - 8 * channel));
  s.id = point.id;
  s.label = static_cast<Label>(point.label);
  return s;
}

/// The cloud of those of `surfels` that `wanted` picks, of which there are `count`.
template <typename Wanted>
PointCloud2 pack(const std::vector<Surfel>& surfels, std::size_t count, Wanted wanted) {
  if (count > kMostSurfels)
    throw Error(std::to_string(count) + " surfels are more than a PointCloud2 can hold: map with a larger decimation, or reset.");
  PointCloud2 cloud;
  for (const Field& field : kFields) {
    cloud.fields.emplace_back();
    cloud.fields.back().name = field.name;
    cloud.fields.back().offset = static_cast<std::uint32_t>(field.offset);
    cloud.fields.back().datatype = field.type;
    cloud.fields.back().count = 1;
  }
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(count);
  cloud.point_step = sizeof(Point);
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.is_bigendian = kThisMachineIsBigEndian;
  cloud.is_dense = true;

  // Appended by the thousand: to resize first would write every page twice.
  cloud.data.reserve(cloud.row_step);
  std::array<Point, 1024> points;
  std::size_t filled = 0;
  const auto flush = [&] {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(points.data());
    cloud.data.insert(cloud.data.end(), bytes, bytes + filled * sizeof(Point));
    filled = 0;
  };
  for (const Surfel& surfel : surfels) {
    if (!wanted(surfel)) continue;
    points[filled++] = to_point(surfel);
    if (filled == points.size()) flush();
  }
  flush();
  return cloud;
}

std::size_t find_offset(const PointCloud2& cloud, const Field& field) {
  const std::string name = field.name;
  const auto found = std::find_if(cloud.fields.begin(), cloud.fields.end(), [&](const PointField& f) { return f.name == name; });
  if (found == cloud.fields.end()) throw Error("The cloud has no field " + name + ": give one of a mapper's.");
  if (found->datatype != field.type || found->count > 1)  // some write 0 for 1
    throw Error("The cloud's field " + name + " is not of the type that a mapper gives it: give one of a mapper's.");
  if (std::uint64_t{found->offset} + bytes_of(field) > cloud.point_step)
    throw Error("The cloud is damaged: its field " + name + " lies outside of the point.");
  return found->offset;
}

/// In 64 bits: damaged sizes overflow 32.
void check_size(const PointCloud2& cloud) {
  if (static_cast<bool>(cloud.is_bigendian) != kThisMachineIsBigEndian)
    throw Error("The cloud comes from a machine of another byte order: run both programs on machines of the same.");
  if (cloud.width == 0 || cloud.height == 0) return;
  const std::uint64_t row = std::uint64_t{cloud.width} * cloud.point_step;
  if (cloud.height > 1 && cloud.row_step < row) throw Error("The cloud is damaged: its rows overlap.");
  const std::uint64_t bytes = (cloud.height - 1) * std::uint64_t{cloud.row_step} + row;
  if (cloud.data.size() < bytes)
    throw Error("The cloud is cut short: it has " + std::to_string(cloud.data.size()) + " bytes instead of " + std::to_string(bytes) + ".");
}

geometry_msgs::Point to_message(const Eigen::Vector3f& p) {
  geometry_msgs::Point message;
  message.x = p.x();
  message.y = p.y();
  message.z = p.z();
  return message;
}

std::uint32_t count32(std::size_t count) {
  return static_cast<std::uint32_t>(std::min<std::size_t>(count, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

PointCloud2 to_cloud(const std::vector<Surfel>& surfels) {
  return pack(surfels, surfels.size(), [](const Surfel&) { return true; });
}

PointCloud2 to_cloud(const SurfelMirror& map, std::optional<Label> only) {
  if (!only) return pack(map.slots(), map.size(), exists);
  const std::size_t count = *only == Label::kOccupied ? map.occupied() : map.size() - map.occupied();
  return pack(map.slots(), count, [label = *only](const Surfel& s) { return exists(s) && s.label == label; });
}

std::vector<Surfel> to_surfels(const PointCloud2& cloud) {
  std::array<std::size_t, kFields.size()> offsets;
  for (std::size_t i = 0; i < kFields.size(); ++i) offsets[i] = find_offset(cloud, kFields[i]);
  check_size(cloud);

  std::vector<Surfel> surfels;
  surfels.reserve(std::size_t{cloud.width} * cloud.height);
  for (std::size_t row = 0; row < cloud.height; ++row) {
    for (std::size_t column = 0; column < cloud.width; ++column) {
      const std::uint8_t* data = &cloud.data[row * cloud.row_step + column * cloud.point_step];
      Point point;
      for (std::size_t i = 0; i < kFields.size(); ++i)
        std::memcpy(reinterpret_cast<std::uint8_t*>(&point) + kFields[i].offset, data + offsets[i], bytes_of(kFields[i]));
      surfels.push_back(to_surfel(point));
    }
  }
  return surfels;
}

SurfelUpdate to_message(const Changes& changes, std::uint64_t since, const Eigen::AlignedBox3f& box) {
  SurfelUpdate message;
  message.sequence = changes.sequence;
  message.since = since;
  message.surfels = to_cloud(changes.updated);
  message.removed = changes.removed;
  message.box_min = to_message(box.min());
  message.box_max = to_message(box.max());
  return message;
}

FrameReport to_message(const Report& report) {
  FrameReport message;
  message.sequence = report.sequence;
  message.surfels = count32(report.surfels);
  message.in_view = count32(report.in_view);
  message.created = count32(report.created);
  message.removed = count32(report.removed);
  message.split = count32(report.split);
  message.map_bytes = report.map_bytes;
  message.device_bytes = report.device_bytes;
  message.view_kept = report.view_kept;
  message.total_ms = report.total_ms;
  for (const StageTime& stage : report.stages) {
    message.stage_names.push_back(stage.name);
    message.stage_ms.push_back(stage.ms);
  }
  return message;
}

}  // namespace frontier_surfels::messages
