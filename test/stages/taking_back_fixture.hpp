/// Frames of a scene in which something is put down, up to the taking back of space behind it.
#pragma once

#include <deque>
#include <limits>
#include <utility>
#include <vector>

#include "frame_fixture.hpp"
#include "reference_views.hpp"
#include "stages/taking_back.hpp"

namespace frontier_surfels {

/// A part of a plane z = depth + slope_x x + slope_y y, in the frame of the scene [m].
struct Plane {
  double depth, slope_x, slope_y;
  Eigen::AlignedBox2d part;  ///< of x and y
};

/// What a camera in the scene measures. @param noise  largest error, as a share of the depth
inline WorkingImage image_of(const std::vector<Plane>& planes, const reference::CameraSetup& camera,
                             const Eigen::Isometry3d& T_scene_camera, double noise, double holes, reference::Random& random) {
  WorkingImage image;
  image.intrinsics = camera.intrinsics;
  const Eigen::Vector3d o = T_scene_camera.translation();
  for (int t = 0; t < camera.intrinsics.height; ++t)
    for (int s = 0; s < camera.intrinsics.width; ++s) {
      const Eigen::Vector3d in_camera((s - camera.intrinsics.cx) / camera.intrinsics.fx, (t - camera.intrinsics.cy) / camera.intrinsics.fy,
                                      1);
      const Eigen::Vector3d ray = T_scene_camera.linear() * in_camera;
      double nearest = std::numeric_limits<double>::infinity();
      for (const Plane& plane : planes) {
        const Eigen::Vector3d normal(-plane.slope_x, -plane.slope_y, 1);
        const double z = (plane.depth - normal.dot(o)) / normal.dot(ray);
        if (z > 0 && plane.part.contains((o + z * ray).head<2>())) nearest = std::min(nearest, z);
      }
      double d = nearest * (1 + random.uniform(-noise, noise));
      if (d > camera.config.z_max) d = -camera.config.z_max;  // free up to there
      if (std::abs(d) < camera.config.z_min || random.chance(holes)) d = 0;
      image.depth.push_back(static_cast<float>(d));
    }
  return image;
}

/// The scene before and after something was put down.
struct TwoScenes {
  std::vector<Plane> before, after;
  double noise, holes;
  Eigen::Isometry3d T_world_scene;
  double motion;  ///< of the camera between frames [m]
};

/// Walls, and tilted boards in front of them, some of which cross the wall: so surfaces lie before the wall by any distance.
inline TwoScenes random_scenes(const reference::CameraSetup& camera, reference::Random& random) {
  const double z_min = camera.config.z_min, z_max = camera.config.z_max, far = 10 * z_max;
  TwoScenes scenes;
  const Eigen::AlignedBox2d everywhere(Eigen::Vector2d(-far, -far), Eigen::Vector2d(far, far));
  const auto slope = [&](double most) { return random.uniform(-most, most); };
  const double wall = random.uniform(0.5, 0.95) * z_max + (random.chance(0.1) ? z_max : 0);
  scenes.before.push_back({wall, slope(0.2), slope(0.2), everywhere});
  scenes.after = scenes.before;
  for (int board = random.whole(1, 2); board > 0; --board) {
    const double depth = random.uniform(1.3 * z_min, std::max(0.9 * std::min(wall, z_max), 1.4 * z_min));
    const double x = slope(0.3) * depth, y = slope(0.3) * depth, half = random.uniform(0.2, 1) * depth;
    scenes.after.push_back({depth, slope(0.6), slope(0.3), {Eigen::Vector2d(x - half, y - half), Eigen::Vector2d(x + half, y + half)}});
  }
  scenes.noise = random.chance(0.3) ? 0.03 : 0.003;
  scenes.holes = random.chance(0.3) ? 0.01 : 0;
  scenes.T_world_scene = random.pose(2, 3);
  scenes.motion = random.chance(0.3) ? 0 : 0.05;
  return scenes;
}

/// The stage, and what it should know: the last frames and the kept views.
class TakingBackFixture : public FrameFixture {
 public:
  explicit TakingBackFixture(const Config& config)
      : FrameFixture(config), taking(commands(), config, map().block_size()), most_kept_(config.recent_views) {
    seen().choose_spacing(config.z_max / 40);
  }

  /// Begins a frame, as Mapper does.
  void start(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera, double z_max) {
    now = {image, T_world_camera, depth_step_for(z_max)};
    ++number_;
    begin(image, T_world_camera);
    open_window();
  }
  void start(const TwoScenes& scenes, bool after, const reference::CameraSetup& camera, reference::Random& random) {
    const Eigen::Isometry3d T_scene_camera = random.pose(scenes.motion, scenes.motion);
    start(image_of(after ? scenes.after : scenes.before, camera, T_scene_camera, scenes.noise, scenes.holes, random),
          scenes.T_world_scene * T_scene_camera, camera.config.z_max);
  }

  /// Sends points that were set since the frame began.
  void open_window() {
    seen().open_window(map().window());
    taking.open_window(map().window(), seen());
  }

  /// By turns as in frames that are likely to take space back, and as in others.
  std::size_t update() { return update(!asked_first); }

  /// @param ask_first  whether the host waits at once for the answer whether the frame takes space back
  std::size_t update(bool ask_first) {
    told = make_frame(camera(), map().window(), views(), &seen(), limits());
    taking.look(camera(), views(), seen(), &told);
    asked_first = ask_first;
    if (!ask_first) {
      const std::size_t count = taking.give_back(camera(), map().window(), now.image, views(), &told);
      commands().wait();
      if (!taking.must_update()) return count;
    }
    return taking.update(camera(), map().window(), now.image, views(), &told);
  }

  void end(bool keep) {
    taking.add_to_last_frames(camera(), now.image, now.T_world_camera, views().current_number());
    if (now.image.depth.size() > largest_) {
      largest_ = now.image.depth.size();
      last.clear();  // as images had no room, they are gone
    }
    last.push_front(now);
    if (last.size() > LAST_FRAMES) last.pop_back();
    if (!keep) return;
    views().keep();
    kept_.push_front({now, number_});
    if (kept_.size() > static_cast<std::size_t>(most_kept_)) kept_.pop_back();
  }

  /// Kept views older than the last frames, newest first.
  std::vector<reference::SeenView> older() const {
    std::vector<reference::SeenView> views;
    for (const auto& [view, number] : kept_)
      if (number + static_cast<int>(last.size()) < number_) views.push_back(view);
    return views;
  }

  TakingBack taking;
  Frame told = {};                       ///< of the last update()
  bool asked_first = false;              ///< of the last update()
  reference::SeenView now;               ///< this frame
  std::deque<reference::SeenView> last;  ///< the last frames, newest first

 private:
  const int most_kept_;
  int number_ = 0;
  std::size_t largest_ = 0;  ///< image so far [pixel]
  std::deque<std::pair<reference::SeenView, int>> kept_;
};

/// Frames before and after something was put down, and the start of the frame that decides.
/// @param others  frames of it alternate with those of `camera`
/// @param before  least and largest number of the frames before
inline void play(TakingBackFixture& fixture, const TwoScenes& scenes, const reference::CameraSetup& camera, reference::Random& random,
                 const reference::CameraSetup* others = nullptr, std::pair<int, int> before = {5, 14}) {
  const auto frame = [&](bool after, double kept) {
    fixture.start(scenes, after, others != nullptr && random.chance(0.4) ? *others : camera, random);
    fixture.end(random.chance(kept));
  };
  for (int n = random.whole(before.first, before.second); n > 0; --n) frame(random.chance(0.15), 0.9);
  const double share = random.chance(0.5) ? 1 : 0.75;
  for (int n = random.chance(0.2) ? random.whole(2, 5) : LAST_FRAMES + random.whole(0, 2); n > 0; --n) frame(random.chance(share), 0.5);
  fixture.start(scenes, true, camera, random);
}

}  // namespace frontier_surfels
