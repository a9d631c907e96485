#include "planner/boundaries.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "config/config_text.hpp"
#include "planner/regions.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "boundaries";
constexpr std::size_t kPagesOfFewPoints = 32;  // points are few if so many pages are around for each

void check(const std::vector<Eigen::Vector3f>& points, double reach) {
  if (!(reach >= 0.001 && reach <= 5)) throw Error("The reach is " + to_text(reach) + " m: it must be from 0.001 to 5 m.");
  if (static_cast<double>(points.size()) > kMostAsked)
    throw Error(std::to_string(points.size()) + " points are asked for at once: at most 100 million can be.");
}

/// Numbers of points in an order in which most are near the ones before and after them.
std::vector<std::uint32_t> by_nearness(const std::vector<Eigen::Vector3f>& points, const std::vector<std::uint32_t>& asked) {
  constexpr float kPerMetre = 8;
  std::vector<std::pair<std::array<int, 3>, std::uint32_t>> places;
  places.reserve(asked.size());
  for (const std::uint32_t n : asked) {
    const Eigen::Array3i at = (kPerMetre * points[n].array()).floor().cast<int>();
    places.push_back({{at.z(), at.y(), at.x()}, n});
  }
  std::sort(places.begin(), places.end());
  std::vector<std::uint32_t> numbers;
  for (const auto& [place, n] : places) numbers.push_back(n);
  return numbers;
}

/// The blocks of a window that have surfels.
struct BlocksOfWindow {
  std::vector<cl_uint> pages, page_begin = {0};  ///< of all blocks, one block after the other
  std::vector<Eigen::Vector3d> centers;          ///< world frame [m]
  double half_size;                              ///< [m]

  BlocksOfWindow(const MapWindow& window, const SurfelMap& map) : half_size(0.5 * map.block_size()) {
    for (const auto& [key, own] : map.index().blocks()) {
      if (!window.is_near(key, 0)) continue;
      pages.insert(pages.end(), own.begin(), own.end());
      page_begin.push_back(static_cast<cl_uint>(pages.size()));
      centers.push_back(2 * half_size * Eigen::Vector3d(key.x + 0.5, key.y + 0.5, key.z + 0.5));
    }
  }

  /// Those that may have a surfel within reach of a point, nearest first: a square that is not larger than that of a distance to a surfel
  /// as a kernel computes it, and the number of the block.
  std::vector<std::pair<float, cl_uint>> near(const Eigen::Vector3d& point, double reach) const {
    constexpr double kSlack = 1e-4;  // [m] more than rounding loses
    std::vector<std::pair<float, cl_uint>> found;
    for (std::size_t n = 0; n < centers.size(); ++n) {
      const double distance = ((point - centers[n]).cwiseAbs().array() - half_size).max(0).matrix().norm() - kSlack;
      if (distance <= reach) found.emplace_back(static_cast<float>(std::pow(std::max(distance, 0.0), 2)), static_cast<cl_uint>(n));
    }
    std::sort(found.begin(), found.end());
    return found;
  }
};

cl_float4 to_float4(const Eigen::Vector3d& v) {
  const Eigen::Vector3f f = v.cast<float>();
  return {{f.x(), f.y(), f.z(), 0}};
}

}  // namespace

Boundaries::Boundaries(Commands& commands, Lists& lists)
    : commands_(commands),
      cells_(commands, lists),
      points_(commands),
      near_squares_(commands),
      pages_(commands),
      page_begin_(commands),
      near_begin_(commands),
      near_(commands),
      boxes_(commands),
      distances_(commands),
      slots_(commands),
      sides_(commands) {}

std::vector<NearestBoundary> Boundaries::nearest(const std::vector<Eigen::Vector3f>& points_world, double reach, const SurfelMap& map) {
  check(points_world, reach);
  std::vector<NearestBoundary> nearest(points_world.size());
  for (const auto& [region, in_region] : by_region(points_world, map.block_size(), "nothing is near it.")) {
    const std::vector<std::uint32_t> asked = by_nearness(points_world, in_region);
    Eigen::AlignedBox3d box;
    for (const std::uint32_t n : asked) box.extend(points_world[n].cast<double>());
    box = {box.min().array() - reach, box.max().array() + reach};
    const MapWindow window(block_at(box.min(), map.block_size()), block_at(box.max(), map.block_size()), map.block_size());
    const std::vector<cl_uint> pages = pages_of(window, map.index());
    if (pages.empty()) continue;
    distances_.resize(asked.size());
    slots_.resize(asked.size());
    sides_.resize(asked.size());
    if (asked.size() * kPagesOfFewPoints <= pages.size())
      look_in_blocks(points_world, asked, reach, window, map);
    else
      look_in_cells(points_world, asked, box, reach, map);
    const std::vector<float> distances = distances_.read(asked.size());
    const std::vector<cl_uint> slots = slots_.read(asked.size());
    const std::vector<cl_uchar> sides = sides_.read(asked.size());
    for (std::size_t n = 0; n < asked.size(); ++n) {
      if (slots[n] == NearestBoundary::kNone) continue;
      nearest[asked[n]] = {distances[n], (sides[n] & BOUNDARY_IN_FRONT) != 0,
                           (sides[n] & BOUNDARY_OCCUPIED) != 0 ? Label::kOccupied : Label::kFrontier, slots[n]};
    }
  }
  return nearest;
}

/// @return from one row of coordinates to the next
std::size_t Boundaries::send_points(const std::vector<Eigen::Vector3f>& points_world, const std::vector<std::uint32_t>& asked,
                                    const Eigen::Vector3d& corner) {
  const std::size_t stride = asked.size() + commands_.lanes();  // whole vectors are read at the rows' ends
  std::vector<float> coordinates(3 * stride, 0.0F);
  for (std::size_t n = 0; n < asked.size(); ++n)
    for (int axis = 0; axis < 3; ++axis) coordinates[axis * stride + n] = static_cast<float>(points_world[asked[n]][axis] - corner[axis]);
  points_.send(std::move(coordinates));
  return stride;
}

/// Many points: listing all surfels by cells first pays.
void Boundaries::look_in_cells(const std::vector<Eigen::Vector3f>& points_world, const std::vector<std::uint32_t>& asked,
                               const Eigen::AlignedBox3d& box, double reach, const SurfelMap& map) {
  cells_.list(box, map);
  const std::size_t stride = send_points(points_world, asked, cells_.corner_world());
  commands_.run(kStage, "find_nearest_boundaries", commands_.chunks(asked.size()), commands_.shape().heavy_group, cells_.window(),
                cells_.cells(), static_cast<cl_float>(reach), map.surfels(), map.page_block(), cells_.entries(), cells_.begin(), points_(),
                static_cast<cl_int>(stride), static_cast<cl_int>(asked.size()), distances_(), slots_(), sides_());
}

/// Few points in a large map: all surfels are tried of the blocks around each that may have the nearest one.
void Boundaries::look_in_blocks(const std::vector<Eigen::Vector3f>& points_world, const std::vector<std::uint32_t>& asked, double reach,
                                const MapWindow& window, const SurfelMap& map) {
  const BlocksOfWindow blocks(window, map);
  std::vector<cl_uint> near_begin = {0}, near;
  std::vector<float> squares;
  for (const std::uint32_t n : asked) {
    for (const auto& [square, block] : blocks.near(points_world[n].cast<double>(), reach)) {
      squares.push_back(square);
      near.push_back(block);
    }
    near_begin.push_back(static_cast<cl_uint>(near.size()));
  }
  if (near.empty()) near.push_back(0), squares.push_back(0);  // no buffer can be empty
  const std::size_t stride = send_points(points_world, asked, window.corner_world());
  pages_.send(blocks.pages);
  page_begin_.send(blocks.page_begin);
  near_begin_.send(std::move(near_begin));
  near_.send(std::move(near));
  near_squares_.send(std::move(squares));
  commands_.run(kStage, "find_nearest_in_blocks", asked.size(), commands_.shape().heavy_group, window.window(),
                static_cast<cl_float>(reach), map.surfels(), map.alive(), map.page_block(), pages_(), page_begin_(), near_begin_(), near_(),
                near_squares_(), points_(), static_cast<cl_int>(stride), static_cast<cl_int>(asked.size()), distances_(), slots_(),
                sides_());
}

std::vector<FirstSurfel> Boundaries::first_within(const std::vector<MovingBox>& boxes, bool frontier_counts, const SurfelMap& map) {
  std::vector<FirstSurfel> first(boxes.size());
  std::vector<Eigen::Vector3f> starts;
  for (const MovingBox& box : boxes) starts.push_back(box.from);
  for (const auto& [region, asked] : by_region(starts, map.block_size(), "no box is there.")) {
    Eigen::AlignedBox3d around;
    for (const std::uint32_t n : asked)
      for (const Eigen::Vector3f& end : {boxes[n].from, boxes[n].to}) {
        around.extend((end - boxes[n].half_size).cast<double>());
        around.extend((end + boxes[n].half_size).cast<double>());
      }
    cells_.list(around, map);
    if (cells_.empty()) continue;

    std::vector<cl_float4> sent;
    for (const std::uint32_t n : asked) {
      sent.push_back(to_float4(boxes[n].from.cast<double>() - cells_.corner_world()));
      sent.push_back(to_float4((boxes[n].to - boxes[n].from).cast<double>()));
      sent.push_back(to_float4(boxes[n].half_size.cast<double>()));
    }
    boxes_.send(std::move(sent));
    distances_.resize(asked.size());
    sides_.resize(asked.size());
    commands_.run(kStage, "move_boxes", asked.size(), commands_.shape().heavy_group, cells_.window(), cells_.cells(),
                  static_cast<cl_int>(frontier_counts), map.surfels(), cells_.entries(), cells_.begin(), boxes_(),
                  static_cast<cl_int>(asked.size()), distances_(), sides_());
    const std::vector<float> shares = distances_.read(asked.size());
    const std::vector<cl_uchar> sides = sides_.read(asked.size());
    for (std::size_t n = 0; n < asked.size(); ++n)
      first[asked[n]] = {shares[n], (sides[n] & BOUNDARY_OCCUPIED) != 0 ? Label::kOccupied : Label::kFrontier};
  }
  return first;
}

}  // namespace frontier_surfels
