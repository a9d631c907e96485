#include "recent_views.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

/// The largest depth in each block of VIEW_BLOCK x VIEW_BLOCK pixels.
std::vector<float> find_block_depths(const WorkingImage& image) {
  const int width = image.intrinsics.width, height = image.intrinsics.height;
  const int columns = (width + VIEW_BLOCK - 1) / VIEW_BLOCK, rows = (height + VIEW_BLOCK - 1) / VIEW_BLOCK;
  std::vector<float> blocks(static_cast<std::size_t>(columns) * rows, 0.0F);
  for (int t = 0; t < height; ++t)
    for (int s = 0; s < width; ++s) {
      float& deepest = blocks[t / VIEW_BLOCK * columns + s / VIEW_BLOCK];
      deepest = std::max(deepest, std::abs(image.depth[t * width + s]));
    }
  return blocks;
}

/// Puts a view into its lane of a group.
void set_lane(const View& view, float* lane) {
  const Transform& T = view.T_camera_world;
  const float fields[VIEW_LANE_FIELDS] = {T.r00,
                                          T.r01,
                                          T.r02,
                                          T.r10,
                                          T.r11,
                                          T.r12,
                                          T.r20,
                                          T.r21,
                                          T.r22,
                                          T.t0,
                                          T.t1,
                                          T.t2,
                                          view.fx,
                                          view.fy,
                                          view.cx,
                                          view.cy,
                                          static_cast<float>(view.width),
                                          static_cast<float>(view.height)};
  for (int n = 0; n < VIEW_LANE_FIELDS; ++n) lane[n * LANES] = fields[n];
}

}  // namespace

Transform to_transform(const Eigen::Isometry3d& T) {
  const Eigen::Matrix<float, 3, 4> m = T.matrix().topRows<3>().cast<float>();
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2), m(0, 3), m(1, 3), m(2, 3)};
}

RecentViews::RecentViews(Commands& commands, const Config& config)
    : config_(config),
      complete_(config.recent_views > 0),
      views_(commands),
      view_lanes_(commands),
      block_depths_(commands),
      depths_(commands) {}

void RecentViews::clear(bool map_is_empty) {
  kept_.clear();
  complete_ = map_is_empty && config_.recent_views > 0;
}

void RecentViews::set_current(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera) {
  const std::vector<float> blocks = find_block_depths(image);
  if (image.depth.size() > room_pixels_ || blocks.size() > room_blocks_) {
    // A larger image than ever before: the kept ones are few and soon replaced.
    const std::size_t most_pixels = std::max(image.depth.size(), room_pixels_), most_blocks = std::max(blocks.size(), room_blocks_);
    depths_.allocate((config_.recent_views + 1) * most_pixels);
    block_depths_.allocate((config_.recent_views + 1) * most_blocks);
    clear(kept_.empty() && complete_);
    room_pixels_ = most_pixels;
    room_blocks_ = most_blocks;
  }
  std::vector<bool> taken(config_.recent_views + 1, false);
  for (const Kept& kept : kept_) taken[kept.room] = true;
  const auto room = std::find(taken.begin(), taken.end(), false) - taken.begin();
  current_ = {image.intrinsics, T_world_camera, static_cast<std::size_t>(room)};
  depths_.write(image.depth, room * room_pixels_);
  block_depths_.write(blocks, room * room_blocks_);
}

View RecentViews::to_view(const Kept& kept, const Eigen::Isometry3d& T_camera_source) const {
  View view = {};
  view.T_camera_world = to_transform(T_camera_source);
  view.fx = static_cast<float>(kept.intrinsics.fx);
  view.fy = static_cast<float>(kept.intrinsics.fy);
  view.cx = static_cast<float>(kept.intrinsics.cx);
  view.cy = static_cast<float>(kept.intrinsics.cy);
  view.width = kept.intrinsics.width;
  view.height = kept.intrinsics.height;
  view.first_pixel = static_cast<std::uint32_t>(kept.room * room_pixels_);
  view.first_block = static_cast<std::uint32_t>(kept.room * room_blocks_);
  return view;
}

View RecentViews::own_view() const { return to_view(current_, Eigen::Isometry3d::Identity()); }

int RecentViews::prepare() {
  std::vector<View> views;
  for (const Kept& kept : kept_) views.push_back(to_view(kept, kept.T_world_camera.inverse() * current_.T_world_camera));
  views_.resize(std::max<std::size_t>(config_.recent_views, 1));
  views_.write(views);
  std::vector<float> lanes(view_groups() * VIEW_LANE_FIELDS * LANES, 0.0F);
  for (std::size_t n = 0; n < views.size(); ++n) set_lane(views[n], &lanes[n / LANES * VIEW_LANE_FIELDS * LANES + n % LANES]);
  view_lanes_.resize(1);
  view_lanes_.write(lanes);
  return static_cast<int>(views.size());
}

bool RecentViews::adds_something() const {
  const double cos_angle = std::cos(config_.recent_view_angle * M_PI / 180);
  return std::none_of(kept_.begin(), kept_.end(), [&](const Kept& kept) {
    const Eigen::Isometry3d motion = kept.T_world_camera.inverse() * current_.T_world_camera;
    const double cos_turn = (motion.linear().trace() - 1) / 2;
    return motion.translation().norm() < config_.recent_view_distance && cos_turn > cos_angle;
  });
}

bool RecentViews::keep_current() {
  if (config_.recent_views == 0 || !adds_something()) return false;
  if (kept_.size() == static_cast<std::size_t>(config_.recent_views)) {
    kept_.pop_back();
    complete_ = false;
  }
  kept_.push_front(current_);
  return true;
}

}  // namespace frontier_surfels
