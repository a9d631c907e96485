#include "recent_views.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {

Transform to_transform(const Eigen::Isometry3d& T) {
  const Eigen::Matrix<float, 3, 4> m = T.matrix().topRows<3>().cast<float>();
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2), m(0, 3), m(1, 3), m(2, 3)};
}

RecentViews::RecentViews(Commands& commands, const Config& config)
    : config_(config), complete_(config.recent_views > 0), views_(commands), depths_(commands) {}

void RecentViews::clear(bool map_is_empty) {
  kept_.clear();
  complete_ = map_is_empty && config_.recent_views > 0;
}

void RecentViews::set_current(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera) {
  if (image.depth.size() > room_pixels_) {  // larger images than ever before: the kept ones are few and soon replaced
    depths_.resize((config_.recent_views + 1) * image.depth.size());
    clear(kept_.empty() && complete_);
    room_pixels_ = image.depth.size();
  }
  std::vector<bool> taken(config_.recent_views + 1, false);
  for (const Kept& kept : kept_) taken[kept.room] = true;
  const auto room = std::find(taken.begin(), taken.end(), false) - taken.begin();
  current_ = {image.intrinsics, T_world_camera, static_cast<std::size_t>(room)};
  depths_.write(image.depth, room * room_pixels_);
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
  return view;
}

View RecentViews::current_view() const { return to_view(current_, current_.T_world_camera.inverse()); }

int RecentViews::prepare() {
  std::vector<View> views;
  for (const Kept& kept : kept_) views.push_back(to_view(kept, kept.T_world_camera.inverse() * current_.T_world_camera));
  views_.resize(std::max<std::size_t>(config_.recent_views, 1));
  views_.write(views);
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
