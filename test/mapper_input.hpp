/// Frames, scores and comparisons for the tests of the whole mapper.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <ostream>
#include <string>
#include <vector>

#include "frontier_surfels/mapper.hpp"
#include "frontier_surfels/scoring/exact_test.hpp"
#include "same_surfels.hpp"
#include "synthetic/synthetic_room.hpp"

namespace frontier_surfels {

using Frames = std::vector<replay::RecordedFrame>;

/// The default configuration for images that already have the working resolution. Rendering fewer pixels makes these tests quick. The lanes
/// are those of FRONTIER_SURFELS_TEST_LANES (16 or 1): at 1 a CPU is used as graphics processors are.
inline Config undecimated() {
  Config config;
  config.decimation = 1;
  if (const char* lanes = std::getenv("FRONTIER_SURFELS_TEST_LANES")) config.lanes = std::atoi(lanes);
  return config;
}

/// The room's camera after decimation by 4, and by 8 (coarse).
inline Intrinsics working_camera() { return replay::synthetic_camera(160, 120); }
inline Intrinsics coarse_camera() { return replay::synthetic_camera(80, 60); }

/// A camera with fx = fy and the principal point in the middle.
inline Intrinsics plain_camera(int width, int height, double focal_length) {
  return {focal_length, focal_length, (width - 1) / 2.0, (height - 1) / 2.0, width, height};
}

/// Pose of a camera at `eye` that looks along `forward` (not vertical) with its x axis level. World frame with z up.
inline Eigen::Isometry3d look_along(const Eigen::Vector3d& eye, const Eigen::Vector3d& forward) {
  const Eigen::Vector3d z = forward.normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return Eigen::Translation3d(eye) * Eigen::Quaterniond(R);
}

inline replay::RecordedFrame plane_frame(const Intrinsics& camera, double depth,
                                         const Eigen::Isometry3d& T_world_camera = Eigen::Isometry3d::Identity()) {
  replay::RecordedFrame frame;
  frame.depth = cv::Mat(camera.height, camera.width, CV_32FC1, cv::Scalar(depth));
  frame.intrinsics = camera;
  frame.T_world_camera = T_world_camera;
  return frame;
}

/// The exact depths that a camera sees of the room [m].
inline replay::RecordedFrame room_frame(const replay::Room& room, const Intrinsics& camera, const Eigen::Isometry3d& T_world_camera) {
  replay::RecordedFrame frame = plane_frame(camera, 0, T_world_camera);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) frame.depth.at<float>(v, u) = static_cast<float>(room.depth(T_world_camera, camera, u, v));
  return frame;
}

/// The first `count` of every `stride`-th frame of a walk around the room's table, which has 200 frames.
inline Frames orbit_frames(const Intrinsics& camera, int count, int stride = 1) {
  const replay::Room room;
  Frames frames;
  for (int n = 0; n < count; ++n) frames.push_back(room.render(n * stride, 200, camera));
  return frames;
}

inline void integrate_all(Mapper& mapper, const Frames& frames) {
  for (const auto& frame : frames) mapper.integrate(frame.view());
}

inline std::vector<Surfel> map_of(const Frames& frames, const Config& config) {
  Mapper mapper(config);
  integrate_all(mapper, frames);
  return mapper.surfels();
}

/// Maps frames. @return them, with the poses with which they were mapped
inline Frames mapped(Mapper& mapper, Frames frames) {
  for (auto& frame : frames) frame.T_world_camera = mapper.integrate(frame.view()).T_world_camera;
  return frames;
}

inline scoring::ExactScore score(const std::vector<Surfel>& surfels, const Frames& frames, const Config& config) {
  scoring::ExactTest exact(config);
  for (const auto& frame : frames) exact.add(frame.view());
  return exact.score(surfels);
}

/// Shares of errors in a score of the exact test.
struct Errors {
  double not_right = 0, beyond_2v = 0, fdr_5cm = 0, miss_2cm = 0, miss_5cm = 0, wrong_label = 0;
};

inline Errors errors_of(const scoring::ExactScore& s) {
  return {1 - s.right, 1 - s.within_2v, s.fdr_5cm, s.miss_2cm, s.miss_5cm, 1 - s.label_ok};
}

/// Expects errors of at most twice the shares that were reached when the test was written. 1e-4 more, a few surfels, is always allowed.
/// @param at_least  part of these shares below which the test is no longer about what its name says
inline void expect_errors(const scoring::ExactScore& s, const Errors& reached, double at_least = 0) {
  const Errors now = errors_of(s);
  const auto expect = [at_least](const char* what, double share, double then) {
    EXPECT_LE(share, 2 * then + 1e-4) << what;
    EXPECT_GE(share, at_least * then - 1e-4) << what << ": if the map has become better, lower the figure in the test";
  };
  expect("surfels that are not right", now.not_right, reached.not_right);
  expect("surfels more than 2 voxels off", now.beyond_2v, reached.beyond_2v);
  expect("surfels more than 5 cm off", now.fdr_5cm, reached.fdr_5cm);
  expect("boundary without a surfel within 2 cm", now.miss_2cm, reached.miss_2cm);
  expect("boundary without a surfel within 5 cm", now.miss_5cm, reached.miss_5cm);
  expect("wrong labels", now.wrong_label, reached.wrong_label);
}

inline std::string text(const scoring::ExactScore& s, std::size_t surfels) {
  char line[200];
  std::snprintf(line, sizeof line,
                "%zu surfels: right %.4f buried %.4f within_2v %.4f fdr_2cm %.4f fdr_5cm %.5f miss_2cm %.5f miss_5cm %.5f label_ok %.4f",
                surfels, s.right, s.buried, s.within_2v, s.fdr_2cm, s.fdr_5cm, s.miss_2cm, s.miss_5cm, s.label_ok);
  return line;
}

/// Is the same remembered, point by point, and are the same views kept?
inline testing::AssertionResult same_memory(const SavedMap& a, const SavedMap& b) {
  if (a.seen.blocks.size() != b.seen.blocks.size())
    return testing::AssertionFailure() << "seen points in " << a.seen.blocks.size() << " blocks against " << b.seen.blocks.size();
  if (!a.seen.blocks.empty() && a.seen.points != b.seen.points)
    return testing::AssertionFailure() << a.seen.points << " points against " << b.seen.points;
  for (std::size_t n = 0; n < a.seen.blocks.size(); ++n)
    if (a.seen.blocks[n].block != b.seen.blocks[n].block || a.seen.blocks[n].bytes != b.seen.blocks[n].bytes)
      return testing::AssertionFailure() << "seen points of block " << n << " of " << a.seen.blocks.size() << " differ";
  if (a.views.size() != b.views.size()) return testing::AssertionFailure() << a.views.size() << " views against " << b.views.size();
  for (std::size_t n = 0; n < a.views.size(); ++n)
    if (a.views[n].T_world_camera.matrix() != b.views[n].T_world_camera.matrix() || a.views[n].depth != b.views[n].depth)
      return testing::AssertionFailure() << "view " << n << " of " << a.views.size() << " differs";
  return testing::AssertionSuccess();
}

/// Are all surfels valid (finite, with a unit normal and a positive radius), and do their ids ascend?
inline testing::AssertionResult all_sound(const std::vector<Surfel>& surfels) {
  for (const Surfel& s : surfels)
    if (!s.position.allFinite() || !(std::abs(s.normal.norm() - 1) < 1e-4F) || !(s.radius > 0) || !std::isfinite(s.radius))
      return testing::AssertionFailure() << "surfel " << s.id << " at " << s.position.transpose() << ", normal " << s.normal.transpose()
                                         << ", radius " << s.radius;
  for (std::size_t n = 1; n < surfels.size(); ++n)
    if (surfels[n - 1].id >= surfels[n].id) return testing::AssertionFailure() << "ids do not ascend at " << n;
  return testing::AssertionSuccess();
}

/// A subscriber's copy of the map, made from changes alone.
class Follower {
 public:
  void apply(const Changes& changes) {
    for (const std::uint32_t id : changes.removed) surfels_.erase(id);
    for (const Surfel& surfel : changes.updated) surfels_[surfel.id] = surfel;
    sequence_ = changes.sequence;
  }
  std::uint64_t sequence() const { return sequence_; }
  std::vector<Surfel> surfels() const {
    std::vector<Surfel> all;
    for (const auto& [id, surfel] : surfels_) all.push_back(surfel);
    return all;
  }

 private:
  std::map<std::uint32_t, Surfel> surfels_;
  std::uint64_t sequence_ = 0;
};

/// what() of the error of kind E that `call` throws; "" if it throws none.
template <typename E, typename Call>
std::string fault_of(Call&& call) {
  try {
    call();
  } catch (const E& error) {
    return error.what();
  }
  return "";
}

}  // namespace frontier_surfels
