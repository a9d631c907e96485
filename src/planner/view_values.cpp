#include "planner/view_values.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "config/config_text.hpp"
#include "frame/recent_views.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "views";
constexpr std::size_t kMostViews = 100000;
constexpr double kMostPixelsInAll = 100e6;                      // mapping waits for the answer
constexpr int kMostPixels = 4096;                               // along an edge of the image
constexpr std::size_t kMostImageBytes = std::size_t{64} << 20;  // of the views that are drawn at once, unless one needs more
constexpr double kFarthest = 1e6;                               // [m] nothing is mapped beyond
constexpr int kSpare = 16;                                      // columns behind an image's end that vectors reach into
constexpr double kCellPixels = 2;                               // surfels are merged where a cell is at most this large in the image

void require(bool fine, const std::string& sentence) {
  if (!fine) throw Error("The question about views cannot be answered: " + sentence);
}

/// What the host needs to know of a camera: an image's edges as tangents.
struct Pyramid {
  double left, right, top, bottom;

  explicit Pyramid(const Intrinsics& c)
      : left((-0.5 - c.cx) / c.fx),
        right((c.width - 0.5 - c.cx) / c.fx),
        top((-0.5 - c.cy) / c.fy),
        bottom((c.height - 0.5 - c.cy) / c.fy) {}

  double longest_ray() const {
    return std::sqrt(1 + std::pow(std::max(std::abs(left), std::abs(right)), 2) + std::pow(std::max(std::abs(top), std::abs(bottom)), 2));
  }

  /// May a ball reach into it?
  bool meets(const Eigen::Vector3d& p, double radius) const {
    const auto within = [&](double x, double low, double high) {
      return x - high * p.z() <= radius * std::sqrt(1 + high * high) && low * p.z() - x <= radius * std::sqrt(1 + low * low);
    };
    return within(p.x(), left, right) && within(p.y(), top, bottom);
  }
};

AskedCamera asked_camera(const ViewQuestion& question) {
  const Intrinsics& c = question.intrinsics;
  AskedCamera camera = {};
  camera.fx = static_cast<float>(c.fx);
  camera.fy = static_cast<float>(c.fy);
  camera.cx = static_cast<float>(c.cx);
  camera.cy = static_cast<float>(c.cy);
  camera.width = c.width;
  camera.height = c.height;
  camera.row = c.width + kSpare;
  camera.image = camera.row * (c.height + kSpare);
  camera.min_range = static_cast<float>(question.min_range);
  camera.range = static_cast<float>(question.range);
  const Pyramid pyramid(c);
  camera.slope_step = static_cast<float>(pyramid.longest_ray() / 4095);
  camera.inverse_fx = 1 / camera.fx;
  camera.inverse_fy = 1 / camera.fy;
  camera.inverse_step = 1 / camera.slope_step;
  camera.left = static_cast<float>(pyramid.left);
  camera.right = static_cast<float>(pyramid.right);
  camera.top = static_cast<float>(pyramid.top);
  camera.bottom = static_cast<float>(pyramid.bottom);
  camera.side_x = static_cast<float>(std::hypot(1, std::max(std::abs(pyramid.left), std::abs(pyramid.right))));
  camera.side_y = static_cast<float>(std::hypot(1, std::max(std::abs(pyramid.top), std::abs(pyramid.bottom))));
  return camera;
}

AskedView asked_view(const ViewQuestion& question, std::size_t n, double block_size) {
  const Eigen::Isometry3d& T = question.T_world_camera[n];
  AskedView view = {};
  const bool far = T.translation().cwiseAbs().maxCoeff() > kFarthest;  // sees nothing
  const Eigen::Array3d origin = far ? Eigen::Array3d::Zero() : (T.translation() / block_size).array().floor().eval();
  const Eigen::Vector3d corner = block_size * origin.matrix();
  view.origin_x = static_cast<cl_int>(origin.x());
  view.origin_y = static_cast<cl_int>(origin.y());
  view.origin_z = static_cast<cl_int>(origin.z());
  const Eigen::Isometry3d T_local_camera = Eigen::Translation3d(-corner) * T;
  view.T_local_camera = to_transform(T_local_camera);
  view.T_camera_local = to_transform(T_local_camera.inverse());
  for (int axis = 0; axis < 3; ++axis) {
    constexpr float kInfinite = std::numeric_limits<float>::infinity();
    view.box_min[axis] = question.box_world ? static_cast<float>(question.box_world->min()[axis] - corner[axis]) : -kInfinite;
    view.box_max[axis] = question.box_world ? static_cast<float>(question.box_world->max()[axis] - corner[axis]) : kInfinite;
  }
  return view;
}

}  // namespace

void check_question(const ViewQuestion& question) {
  const std::size_t count = question.T_world_camera.size();
  require(count > 0, "T_world_camera has no poses.");
  require(count <= kMostViews, "T_world_camera has " + std::to_string(count) + " poses, more than " + std::to_string(kMostViews) + ".");
  for (std::size_t n = 0; n < count; ++n)
    require(question.T_world_camera[n].matrix().allFinite(), "T_world_camera[" + std::to_string(n) + "] is not finite.");
  const Intrinsics& c = question.intrinsics;
  for (const auto& [name, size] : {std::pair("width", c.width), std::pair("height", c.height)})
    require(size >= 1 && size <= kMostPixels, std::string("intrinsics.") + name + " is " + std::to_string(size) +
                                                  ", but must be from 1 to " + std::to_string(kMostPixels) + " pixels.");
  const double pixels = static_cast<double>(count) * c.width * c.height;
  require(pixels <= kMostPixelsInAll, "T_world_camera has " + std::to_string(count) + " poses of " + std::to_string(c.width) + " x " +
                                          std::to_string(c.height) + " pixels, more than 100 million in all: divide the question.");
  for (const auto& [name, focal] : {std::pair("fx", c.fx), std::pair("fy", c.fy)})
    require(focal >= 1e-3 && focal <= 1e6,
            std::string("intrinsics.") + name + " is " + to_text(focal) + ", but must be from 0.001 to 1e6 pixels.");
  for (const auto& [name, center] : {std::pair("cx", c.cx), std::pair("cy", c.cy)})
    require(std::abs(center) <= 1e6, std::string("intrinsics.") + name + " is " + to_text(center) + ", but must be within 1e6 pixels.");
  require(question.range >= 0.05 && question.range <= 100, "range is " + to_text(question.range) + ", but must be from 0.05 to 100 m.");
  require(question.min_range >= 0 && question.min_range <= question.range,
          "min_range is " + to_text(question.min_range) + ", but must be from 0 m to range.");
  require(question.most_clearance >= 0 && question.most_clearance <= 5,
          "most_clearance is " + to_text(question.most_clearance) + ", but must be from 0 to 5 m.");
  if (question.box_world)
    require((question.box_world->min().array() <= question.box_world->max().array()).all(),
            "box_world has a minimum that is larger than its maximum, or not a number.");
}

/// Which blocks the views may see, in which order and which are so far that their surfels are merged.
struct ViewValues::Plan {
  std::vector<AskedView> views;
  std::vector<cl_uint> blocks;                  ///< see draw_views
  std::vector<const BlockIndex::Pages*> pages;  ///< of each block that some view may see
  std::vector<cl_uint> levels;  ///< of each of these blocks: levels of merged surfels that some view draws, bit 0 for level 1

  Plan(const ViewQuestion& question, std::size_t begin, std::size_t end, const SurfelMap& map)
      : question_(question),
        pyramid_(question.intrinsics),
        size_(map.block_size()),
        radius_(std::sqrt(0.75) * size_ + map.largest_radius()),
        focal_(std::max(question.intrinsics.fx, question.intrinsics.fy)) {
    for (const auto& [key, pages_of_block] : map.index().blocks()) all_.push_back({size_ * center_of(key), &pages_of_block, -1});
    for (std::size_t n = begin; n < end; ++n) add_view(n);
  }

 private:
  struct Block {
    Eigen::Vector3d center;  ///< world frame [m]
    const BlockIndex::Pages* pages;
    int number;  ///< in Plan::pages, or -1
  };

  static Eigen::Vector3d center_of(const BlockKey& key) { return {key.x + 0.5, key.y + 0.5, key.z + 0.5}; }

  void add_view(std::size_t n) {
    AskedView view = asked_view(question_, n, size_);
    const Eigen::Isometry3d T_camera_world = question_.T_world_camera[n].inverse();
    std::vector<std::pair<float, std::uint32_t>> seen;  // depth; number in all_
    for (std::uint32_t m = 0; m < all_.size(); ++m) {
      const Eigen::Vector3d p = T_camera_world * all_[m].center;
      if (p.z() + radius_ >= VIEW_NEAR && p.z() - radius_ <= question_.range && pyramid_.meets(p, radius_))
        seen.emplace_back(static_cast<float>(p.z()), m);
    }
    std::sort(seen.begin(), seen.end());
    const double half_depth = 0.5 * size_ * T_camera_world.linear().row(2).cwiseAbs().sum();
    view.first_block = static_cast<cl_int>(blocks.size());
    for (const auto& [depth, m] : seen) {
      Block& block = all_[m];
      if (block.number < 0) {
        block.number = static_cast<int>(pages.size());
        pages.push_back(block.pages);
        levels.push_back(0);
      }
      const int level = merge_level(depth - half_depth);
      if (level > 0) levels[block.number] |= 1U << (level - 1);
      blocks.push_back(static_cast<cl_uint>((MERGE_LEVELS + 1) * block.number + level));
    }
    view.end_block = static_cast<cl_int>(blocks.size());
    views.push_back(view);
  }

  /// The last level whose cells are at most kCellPixels large at this depth, or 0.
  int merge_level(double depth) const {
    int level = 0;
    for (double cell = size_ / MERGE_CELLS; level < MERGE_LEVELS && cell * focal_ <= kCellPixels * depth; cell *= 2) ++level;
    return level;
  }

  const ViewQuestion& question_;
  const Pyramid pyramid_;
  const double size_, radius_, focal_;
  std::vector<Block> all_;
};

ViewValues::ViewValues(Commands& commands)
    : commands_(commands),
      merged_(commands),
      views_(commands),
      blocks_(commands),
      images_(commands),
      tiles_(commands),
      areas_(commands),
      counts_(commands) {}

std::vector<ViewValue> ViewValues::find(const ViewQuestion& question, const SurfelMap& map, std::uint64_t now) {
  std::vector<ViewValue> values(question.T_world_camera.size());
  const std::size_t image_bytes = asked_camera(question).image * sizeof(cl_uint);
  const std::size_t at_once = std::clamp(kMostImageBytes / image_bytes, std::size_t{1}, std::size_t{1000});
  try {
    for (std::size_t begin = 0; begin < values.size(); begin += at_once)
      find_some(question, begin, std::min(begin + at_once, values.size()), map, now, values);
  } catch (...) {
    merged_.forget();  // it may not have been merged
    throw;
  }
  return values;
}

/// A CPU draws a view with one item, and its image stays in one core's cache; other devices need many items. The values do not depend on
/// it.
std::size_t ViewValues::items_per_view(std::size_t views) const {
  const std::size_t items = commands_.shape().view_items;
  return std::clamp(items / views, std::size_t{1}, std::size_t{256});
}

void ViewValues::find_some(const ViewQuestion& question, std::size_t begin, std::size_t end, const SurfelMap& map, std::uint64_t now,
                           std::vector<ViewValue>& values) {
  Plan plan(question, begin, end, map);
  const AskedCamera camera = asked_camera(question);
  const std::size_t count = end - begin, rows = count * camera.height;
  merged_.merge(kStage, map, plan.pages, plan.levels, now);
  views_.send(std::move(plan.views));
  images_.resize(count * camera.image);
  images_.fill(kStage, VIEW_NOTHING, count * camera.image);
  const std::size_t image_tiles =
      std::size_t{1} * (camera.width / HIDING_TILE + HIDING_SPARE) * ((camera.height + HIDING_TILE - 1) / HIDING_TILE);
  const std::size_t per_view = items_per_view(count);
  tiles_.resize(per_view > 1 ? 1 : count * image_tiles);
  if (per_view == 1) tiles_.fill(kStage, VIEW_NOTHING, count * image_tiles);
  if (!plan.blocks.empty()) {
    blocks_.send(std::move(plan.blocks));
    commands_.run(kStage, "draw_views", count * per_view, commands_.shape().heavy_group, camera, static_cast<cl_float>(map.block_size()),
                  static_cast<cl_float>(map.largest_radius()), views_(), static_cast<cl_int>(count), static_cast<cl_int>(per_view),
                  blocks_(), map.surfels(), map.alive(), map.page_block(), merged_.pages(), merged_.page_begin(), merged_.places(),
                  merged_.surfels(), merged_.counts(), images_(), static_cast<cl_uint>(image_tiles), tiles_());
  }
  areas_.resize(2 * rows);
  counts_.resize(VIEW_COUNTS * rows);
  commands_.run(kStage, "count_views", rows, commands_.shape().heavy_group, camera, views_(), static_cast<cl_int>(count), images_(),
                areas_(), counts_());

  const std::vector<cl_ulong> areas = areas_.read(2 * rows);
  const std::vector<cl_uint> counts = counts_.read(VIEW_COUNTS * rows);
  const double to_area = 1 / (VIEW_AREA_ONE * question.intrinsics.fx * question.intrinsics.fy);
  for (std::size_t n = 0; n < count; ++n) {
    ViewValue& value = values[begin + n];
    double frontier = 0, occupied = 0;  // sums of whole numbers
    for (std::size_t row = n * camera.height; row < (n + 1) * camera.height; ++row) {
      frontier += static_cast<double>(areas[2 * row]);
      occupied += static_cast<double>(areas[2 * row + 1]);
      value.frontier_pixels += counts[VIEW_COUNTS * row + VIEW_COUNT_FRONTIER];
      value.occupied_pixels += counts[VIEW_COUNTS * row + VIEW_COUNT_OCCUPIED];
      value.beyond_range_pixels += counts[VIEW_COUNTS * row + VIEW_COUNT_NOTHING];
    }
    value.frontier_area = static_cast<float>(frontier * to_area);
    value.occupied_area = static_cast<float>(occupied * to_area);
  }
}

}  // namespace frontier_surfels
