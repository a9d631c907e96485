/// The map of a room with known surfaces, compared with what the frames have seen and with the room itself.
#include <gtest/gtest.h>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

using Eigen::Vector3d;

constexpr double kVoxelsOfRadius = 2 / 1.7320508;  // a new surfel's radius is sqrt(3)/2 voxels

/// A walk around the room and its map, made once for all tests.
struct Walk {
  Config config = undecimated();
  replay::Room room;
  Frames frames = orbit_frames(working_camera(), 20, 4);
  Mapper mapper = Mapper(config);
  Frames as_mapped = mapped(mapper, frames);
  std::vector<Surfel> surfels = mapper.surfels();

  static const Walk& instance() {
    static const Walk walk;
    return walk;
  }

  /// Does a ray of a frame pass through p? Decided by the room's geometry, without pixels and rounding.
  bool seen(const Vector3d& p_world) const {
    return std::any_of(frames.begin(), frames.end(), [&](const replay::RecordedFrame& frame) {
      const Intrinsics& camera = frame.intrinsics;
      const Vector3d p = frame.T_world_camera.inverse() * p_world;
      if (p.z() <= 0) return false;
      const double u = p.x() / p.z() * camera.fx + camera.cx, v = p.y() / p.z() * camera.fy + camera.cy;
      if (u < -0.5 || v < -0.5 || u >= camera.width - 0.5 || v >= camera.height - 0.5) return false;
      const double depth = room.depth(frame.T_world_camera, camera, u, v);
      return config.z_min <= depth && depth <= config.z_max && p.z() < depth;
    });
  }
};

/// Share of every `stride`-th surfel for which `holds` is true.
template <typename Predicate>
double share(const std::vector<Surfel>& surfels, std::size_t stride, Predicate&& holds) {
  std::size_t count = 0, held = 0;
  for (std::size_t n = 0; n < surfels.size(); n += stride) {
    const Surfel& s = surfels[n];
    ++count;
    held += holds(s.position.cast<double>(), s.normal.cast<double>(), kVoxelsOfRadius * s.radius);
  }
  return count > 0 ? static_cast<double>(held) / static_cast<double>(count) : 0;
}

TEST(MapperRoom, MeasuresUpToTheExactTest) {
  const Walk& walk = Walk::instance();
  const auto s = score(walk.surfels, walk.as_mapped, walk.config);
  SCOPED_TRACE(text(s, walk.surfels.size()));
  expect_errors(s, {0.00032, 0.00042, 0.00008, 0.00071, 0.00000, 0.01109});
  EXPECT_GT(s.boundary_points, 10000U);
  EXPECT_TRUE(all_sound(walk.surfels));
}

/// The paper's method alone is less accurate. What it reaches must not change unnoticed in either direction.
TEST(MapperRoom, ThePapersConfigurationMeasuresUpToTheExactTest) {
  const Walk& walk = Walk::instance();
  Config config = load_config(FRONTIER_SURFELS_SOURCE_DIR "/config/paper.yaml");
  config.decimation = walk.config.decimation;
  const std::vector<Surfel> surfels = map_of(walk.frames, config);
  const auto s = score(surfels, walk.frames, config);
  SCOPED_TRACE(text(s, surfels.size()));
  EXPECT_TRUE(all_sound(surfels));
  expect_errors(s, {0.02243, 0.00467, 0.00257, 0.16953, 0.07917, 0.03920}, 0.5);
}

TEST(MapperRoom, OccupiedSurfelsLieOnTheRoomsSurfaces) {
  const Walk& walk = Walk::instance();
  std::vector<Surfel> occupied;
  std::copy_if(walk.surfels.begin(), walk.surfels.end(), std::back_inserter(occupied),
               [](const Surfel& s) { return s.label == Label::kOccupied; });
  ASSERT_GT(occupied.size(), 30000U);
  const auto off = [&](double voxels) {
    return share(occupied, 1,
                 [&](const Vector3d& p, const Vector3d&, double voxel) { return std::abs(walk.room.distance(p)) > voxels * voxel; });
  };
  EXPECT_LE(off(1), 0.0108);
  EXPECT_LE(off(2), 0.0024);
  EXPECT_LE(share(occupied, 1,
                  [&](const Vector3d& p, const Vector3d& normal, double voxel) {
                    return walk.room.distance(p + 2 * voxel * normal) < walk.room.distance(p);
                  }),
            0.0012)
      << "normals point into solids";
}

TEST(MapperRoom, NoSurfelIsInsideASolidOrDeepInKnownOrUnknownSpace) {
  const Walk& walk = Walk::instance();
  EXPECT_LE(share(walk.surfels, 1, [&](const Vector3d& p, const Vector3d&, double voxel) { return walk.room.distance(p) < -2 * voxel; }),
            1e-4);

  /// Number of seen points among seven: six at `distance` from a surfel along the axes, and one in front of it.
  const auto seen_around = [&](const Vector3d& p, const Vector3d& normal, double distance) {
    int count = walk.seen(p + distance * normal);
    for (int axis = 0; axis < 3; ++axis)
      for (const double sign : {-1.0, 1.0}) count += walk.seen(p + sign * distance * Vector3d::Unit(axis));
    return count;
  };
  EXPECT_LE(share(walk.surfels, 20, [&](const Vector3d& p, const Vector3d& n, double voxel) { return seen_around(p, n, voxel) == 7; }),
            0.0018)
      << "all space around a surfel is known";
  EXPECT_LE(share(walk.surfels, 20, [&](const Vector3d& p, const Vector3d& n, double voxel) { return seen_around(p, n, 2 * voxel) == 0; }),
            0.014)
      << "no space around a surfel is known";
  EXPECT_LE(share(walk.surfels, 20, [&](const Vector3d& p, const Vector3d& n, double voxel) { return walk.seen(p - voxel * n); }), 0.0185)
      << "the space behind a surfel is known";
}

TEST(MapperRoom, EverySurfaceThatWasSeenHasItsSurfels) {
  const Walk& walk = Walk::instance();
  cv::RNG random(3);
  int points = 0, bare = 0, not_occupied = 0;
  while (points < 500) {
    const auto& frame = walk.frames[random.uniform(0, static_cast<int>(walk.frames.size()))];
    const Intrinsics& camera = frame.intrinsics;
    const int u = random.uniform(0, camera.width), v = random.uniform(0, camera.height);
    const double depth = frame.depth.at<float>(v, u);
    if (depth < walk.config.z_min || depth > walk.config.z_max) continue;
    ++points;
    const Vector3d q = frame.T_world_camera * Vector3d((u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth, depth);
    const auto nearest = std::min_element(walk.surfels.begin(), walk.surfels.end(),
                                          [q = Eigen::Vector3f(q.cast<float>())](const Surfel& a, const Surfel& b) {
                                            return (a.position - q).squaredNorm() < (b.position - q).squaredNorm();
                                          });
    bare += (nearest->position.cast<double>() - q).norm() > 1.5 * depth / camera.fx;
    not_occupied += nearest->label != Label::kOccupied;
  }
  EXPECT_LE(bare, 4) << "of 500 points; pixels are far apart on slanting surfaces";
  EXPECT_LE(not_occupied, 45);
}

}  // namespace
}  // namespace frontier_surfels
