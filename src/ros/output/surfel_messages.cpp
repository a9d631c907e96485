#include "ros/output/surfel_messages.hpp"

#include <boost/predef/other/endian.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <limits>
#include <string>

#include "frontier_surfels/cloud_color.hpp"
#include "ros/input/conversions.hpp"

namespace frontier_surfels::messages {
namespace {

using sensor_msgs::PointCloud2;
using sensor_msgs::PointField;

const std::vector<std::uint32_t> kNone;
constexpr bool kThisMachineIsBigEndian = BOOST_ENDIAN_BIG_BYTE;

/// A surfel in a cloud: pcl::PointSurfel with id and label in its gaps.
struct Point {
  float position[3];
  std::uint32_t id;
  float normal[3];
  std::uint32_t label;
  std::uint32_t rgb;  // cloud_color.hpp
  float radius, confidence, curvature;
};
static_assert(sizeof(Point) == kBytesOfSurfel, "points are copied as they lie in memory");

struct Field {
  const char* name;
  std::uint8_t type;
  std::size_t offset;  ///< [byte] in Point
};
constexpr std::size_t kFieldBytes = 4;     // of every field
constexpr std::size_t kSurfelFields = 10;  // the first of kFields, which are needed to read a cloud
constexpr std::array<Field, 12> kFields = {{{"x", PointField::FLOAT32, offsetof(Point, position)},
                                            {"y", PointField::FLOAT32, offsetof(Point, position) + 4},
                                            {"z", PointField::FLOAT32, offsetof(Point, position) + 8},
                                            {"id", PointField::UINT32, offsetof(Point, id)},
                                            {"normal_x", PointField::FLOAT32, offsetof(Point, normal)},
                                            {"normal_y", PointField::FLOAT32, offsetof(Point, normal) + 4},
                                            {"normal_z", PointField::FLOAT32, offsetof(Point, normal) + 8},
                                            {"label", PointField::UINT32, offsetof(Point, label)},
                                            {"rgb", PointField::FLOAT32, offsetof(Point, rgb)},
                                            {"radius", PointField::FLOAT32, offsetof(Point, radius)},
                                            {"confidence", PointField::FLOAT32, offsetof(Point, confidence)},
                                            {"curvature", PointField::FLOAT32, offsetof(Point, curvature)}}};

Point to_point(const Surfel& s, Label confident) {
  Point point = {};
  std::memcpy(point.position, s.position.data(), sizeof(point.position));
  std::memcpy(point.normal, s.normal.data(), sizeof(point.normal));
  point.id = s.id;
  point.label = static_cast<std::uint32_t>(s.label);
  point.rgb = to_cloud_color(s);
  point.radius = s.radius;
  point.confidence = s.label == confident ? 1 : 0;
  return point;
}

Surfel to_surfel(const Point& point) {
  if (point.label > 1) throw Error("The cloud is damaged: " + std::to_string(point.label) + " is no label (0 frontier, 1 occupied).");
  Surfel s;
  std::memcpy(s.position.data(), point.position, sizeof(point.position));
  std::memcpy(s.normal.data(), point.normal, sizeof(point.normal));
  s.radius = point.radius;
  s.rgb = from_cloud_color(point.rgb);
  s.id = point.id;
  s.label = static_cast<Label>(point.label);
  return s;
}

/// A cloud of `count` surfels. @param next  returns one after the other
template <typename Next>
PointCloud2 pack(std::size_t count, Label confident, const Next& next) {
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

  // Surfels are appended by the thousand. Resizing `data` first would write every page of memory twice.
  cloud.data.reserve(cloud.row_step);
  std::array<Point, 1024> points;
  std::size_t filled = 0;
  const auto flush = [&] {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(points.data());
    cloud.data.insert(cloud.data.end(), bytes, bytes + filled * sizeof(Point));
    filled = 0;
  };
  for (std::size_t n = 0; n < count; ++n) {
    points[filled++] = to_point(next(), confident);
    if (filled == points.size()) flush();
  }
  flush();
  return cloud;
}

/// @throws Error if this number of surfels does not go into a message
void check_count(std::size_t count, std::size_t most) {
  if (count <= most) return;
  throw Error(
      std::to_string(count) + " surfels are more than a message may have (" + std::to_string(most) +
      ", see ~message_limit): call ~get_surfels with smaller boxes, or with `most` and `first_id` for parts, or subscribe ~update, " +
      "which brings the whole map in parts.");
}

/// Number of messages for this number of things.
std::size_t messages_for(std::size_t count, std::size_t most) { return (count + most - 1) / most; }

std::size_t find_offset(const PointCloud2& cloud, const Field& field) {
  const std::string name = field.name;
  const auto found = std::find_if(cloud.fields.begin(), cloud.fields.end(), [&](const PointField& f) { return f.name == name; });
  if (found == cloud.fields.end()) throw Error("The cloud has no field " + name + ": give one of a mapper's.");
  if (found->datatype != field.type || found->count > 1)  // some programs write 0 instead of 1
    throw Error("The cloud's field " + name + " is not of the type that a mapper gives it: give one of a mapper's.");
  if (std::uint64_t{found->offset} + kFieldBytes > cloud.point_step)
    throw Error("The cloud is damaged: its field " + name + " lies outside of the point.");
  return found->offset;
}

/// Computes in 64 bits, because damaged sizes overflow 32.
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

std::uint32_t count32(std::size_t count) {
  return static_cast<std::uint32_t>(std::min<std::size_t>(count, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

PointCloud2 to_cloud(const std::vector<Surfel>& surfels, Label confident, std::size_t most) {
  check_count(surfels.size(), most);
  auto at = surfels.begin();
  return pack(surfels.size(), confident, [&]() -> const Surfel& { return *at++; });
}

PointCloud2 to_cloud(const SurfelMirror& map, Label confident, std::optional<Label> only, std::size_t most) {
  const std::size_t count = !only ? map.size() : *only == Label::kOccupied ? map.occupied() : map.size() - map.occupied();
  check_count(count, most);
  auto at = map.slots().begin();
  return pack(count, confident, [&]() -> const Surfel& {
    while (only && at->label != *only) ++at;
    return *at++;
  });
}

std::vector<Surfel> to_surfels(const PointCloud2& cloud) {
  std::array<std::size_t, kSurfelFields> offsets;
  for (std::size_t i = 0; i < offsets.size(); ++i) offsets[i] = find_offset(cloud, kFields[i]);
  check_size(cloud);

  std::vector<Surfel> surfels;
  surfels.reserve(std::size_t{cloud.width} * cloud.height);
  for (std::size_t row = 0; row < cloud.height; ++row) {
    for (std::size_t column = 0; column < cloud.width; ++column) {
      const std::uint8_t* data = &cloud.data[row * cloud.row_step + column * cloud.point_step];
      Point point;
      for (std::size_t i = 0; i < offsets.size(); ++i)
        std::memcpy(reinterpret_cast<std::uint8_t*>(&point) + kFields[i].offset, data + offsets[i], kFieldBytes);
      surfels.push_back(to_surfel(point));
    }
  }
  return surfels;
}

UpdateMessages::UpdateMessages(const Changes& changes, std::uint64_t since, const Eigen::AlignedBox3f& box, Label confident,
                               std::size_t most)
    : sequence_(changes.sequence),
      since_(since),
      next_surfel_([at = changes.updated.begin()]() mutable -> const Surfel& {
        while (!exists(*at)) ++at;
        return *at++;
      }),
      removed_(changes.removed),
      box_(box),
      confident_(confident),
      most_(most),
      surfels_left_(static_cast<std::size_t>(std::count_if(changes.updated.begin(), changes.updated.end(), exists))) {
  count_parts();
}

UpdateMessages::UpdateMessages(const SurfelMirror& map, const Eigen::AlignedBox3f& box, Label confident, std::size_t most)
    : sequence_(map.sequence()),
      since_(0),
      next_surfel_([at = map.slots().begin()]() mutable -> const Surfel& { return *at++; }),
      removed_(kNone),
      box_(box),
      confident_(confident),
      most_(most),
      surfels_left_(map.size()) {
  count_parts();
}

/// The last message with removed ids is the first one with surfels.
void UpdateMessages::count_parts() {
  const std::size_t before = removed_.empty() ? 0 : messages_for(removed_.size(), most_) - 1;
  parts_ = static_cast<std::uint32_t>(before + std::max<std::size_t>(messages_for(surfels_left_, most_), 1));
}

SurfelUpdate UpdateMessages::next() {
  SurfelUpdate message;
  message.sequence = sequence_;
  message.since = since_;
  message.part = part_++;
  message.parts = parts_;
  message.box_min = to_point(box_.min().cast<double>());
  message.box_max = to_point(box_.max().cast<double>());

  const std::size_t removed_end = std::min(removed_.size(), removed_sent_ + most_);
  message.removed.assign(removed_.begin() + static_cast<std::ptrdiff_t>(removed_sent_),
                         removed_.begin() + static_cast<std::ptrdiff_t>(removed_end));
  removed_sent_ = removed_end;

  const std::size_t count = removed_sent_ == removed_.size() ? std::min(surfels_left_, most_) : 0;
  message.surfels = pack(count, confident_, next_surfel_);
  surfels_left_ -= count;
  return message;
}

FrameReport to_message(const Report& report) {
  FrameReport message;
  message.sequence = report.sequence;
  message.pose = to_pose(report.T_world_camera);
  message.surfels = count32(report.surfels);
  message.in_view = count32(report.in_view);
  message.measured_pixels = count32(report.measured_pixels);
  message.taken_back = count32(report.taken_back);
  message.created = count32(report.created);
  message.removed = count32(report.removed);
  message.split = count32(report.split);
  message.map_bytes = report.map_bytes;
  message.seen_bytes = report.seen_bytes;
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
