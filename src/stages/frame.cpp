#include "stages/frame.hpp"

namespace frontier_surfels {

Frame make_frame(const MapWindow& window, const SeenPoints* seen) {
  Frame frame = {};
  frame.window = window.window();
  frame.T_camera_local = frame.T_local_camera = to_transform(Eigen::Isometry3d::Identity());
  frame.has_seen = seen == nullptr || seen->empty() ? 0 : 1;
  frame.seen_shift = seen == nullptr ? 0 : seen->shift();
  return frame;
}

Frame make_frame(const Camera& camera, const MapWindow& window, const RecentViews& views, const SeenPoints* seen, const Limits& limits) {
  Frame frame = make_frame(window, seen);
  frame.grid = camera.grid();
  frame.limits = limits;
  frame.T_camera_local = to_transform(window.T_camera_local());
  frame.T_local_camera = to_transform(window.T_camera_local().inverse());
  frame.own_view = views.own_view();
  frame.has_color = camera.has_color() ? 1 : 0;
  return frame;
}

}  // namespace frontier_surfels
