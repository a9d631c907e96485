/// Maps far from the world's origin, and large maps: the map of a place depends neither on its coordinates nor on the rest of the map.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <tuple>

#include "frontier_surfels/ply.hpp"
#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

using Eigen::Vector3d;

/// Pose of a camera that looks along an axis of the world, so that shifting the camera is exact.
Eigen::Isometry3d look_along_axis(const Vector3d& eye, const Vector3d& axis) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear().col(0) = axis.cross(Vector3d::UnitZ());
  pose.linear().col(1) = -Vector3d::UnitZ();
  pose.linear().col(2) = axis;
  pose.translation() = eye;
  return pose;
}

/// Frames in all directions from the middle of the room, and towards its walls.
Frames frames_along_axes() {
  const replay::Room room;
  Frames frames;
  for (const Vector3d& axis : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(-1, 0, 0), Vector3d(0, -1, 0)})
    for (const double step : {0.0, 0.25, 0.75})
      frames.push_back(room_frame(room, coarse_camera(), look_along_axis(Vector3d(0.8125, 1.25, 1.375) + step * axis, axis)));
  return frames;
}

Config few_views() {
  Config config = undecimated();
  config.recent_views = 4;  // so that known space is computed from the surfels as well
  return config;
}

/// The map is the same wherever it lies. Returned positions are rounded to floats, which are coarse far from the origin.
TEST(MapperLarge, TheSameMapFarAway) {
  Frames frames = frames_along_axes();
  const std::vector<Surfel> here = map_of(frames, few_views());
  ASSERT_GT(here.size(), 20000u);
  for (const Vector3d& shift : {Vector3d(16, -24.5, 8), Vector3d(4096, -8192, 512), Vector3d(-50000, 50000, 128)}) {
    SCOPED_TRACE(testing::Message() << "shifted by " << shift.transpose());
    Frames shifted = frames;
    for (auto& frame : shifted) frame.T_world_camera.pretranslate(shift);
    std::vector<Surfel> expected = here;
    for (Surfel& s : expected) s.position = (s.position.cast<double>() + shift).cast<float>();
    EXPECT_TRUE(same(expected, map_of(shifted, few_views())));
  }
}

std::vector<Surfel> sorted_near(std::vector<Surfel> surfels) {
  surfels.erase(std::remove_if(surfels.begin(), surfels.end(), [](const Surfel& s) { return s.position.norm() > 30; }), surfels.end());
  const auto key = [](const Surfel& s) {
    return std::make_tuple(s.position.x(), s.position.y(), s.position.z(), s.normal.x(), s.normal.y(), s.radius);
  };
  std::sort(surfels.begin(), surfels.end(), [&](const Surfel& a, const Surfel& b) { return key(a) < key(b); });
  for (std::size_t n = 0; n < surfels.size(); ++n) surfels[n].id = static_cast<std::uint32_t>(n);
  return surfels;
}

/// Surfels about 100 m away: many blocks with one surfel each, and a few blocks with very many.
std::vector<Surfel> far_away() {
  cv::RNG random(1);
  std::vector<Surfel> surfels(60000);
  for (std::size_t n = 0; n < surfels.size(); ++n) {
    const float spread = n % 2 == 0 ? 30 : 0.4F;
    for (int axis = 0; axis < 3; ++axis) surfels[n].position[axis] = 100 + random.uniform(-spread, spread);
    surfels[n].radius = 0.01F;
  }
  return surfels;
}

TEST(MapperLarge, AMapElsewhereDoesNotMatter) {
  const Frames frames = orbit_frames(coarse_camera(), 6, 5);
  std::vector<Surfel> near = map_of({frames.begin(), frames.begin() + 3}, undecimated()), all = far_away();
  const std::size_t far = all.size();
  all.insert(all.begin() + 20000, near.begin(), near.end());
  Mapper alone(undecimated()), large(undecimated());
  alone.load(near);
  large.load(all);
  EXPECT_EQ(large.size(), far + near.size());
  const std::vector<Surfel> loaded = large.surfels();
  EXPECT_TRUE(all_sound(loaded));
  const std::uint64_t first = large.changes(0).sequence;
  std::uint64_t told = large.changes(0).sequence;  // two subscribers
  for (std::size_t n = 3; n < frames.size(); ++n) {
    const Report a = alone.integrate(frames[n].view()), b = large.integrate(frames[n].view());
    EXPECT_TRUE(a.created == b.created && a.removed == b.removed && a.split == b.split && a.in_view == b.in_view);
    EXPECT_EQ(b.surfels, a.surfels + far);
    const Changes changes = large.changes(told);
    EXPECT_EQ(changes.since, told);
    EXPECT_LT(changes.updated.size(), near.size() + b.created) << "more than the frame has changed";
    told = changes.sequence;
  }
  const std::vector<Surfel> after = large.surfels();
  EXPECT_TRUE(same(sorted_near(alone.surfels()), sorted_near(after)));
  const auto is_far = [](const Surfel& s) { return s.position.norm() > 30; };
  std::vector<Surfel> far_before, far_after;
  std::copy_if(loaded.begin(), loaded.end(), std::back_inserter(far_before), is_far);
  std::copy_if(after.begin(), after.end(), std::back_inserter(far_after), is_far);
  EXPECT_TRUE(same(far_before, far_after));

  // A late subscriber gets the whole map, another one only the changes.
  Follower late, other;
  late.apply(large.changes(0));
  EXPECT_TRUE(same(after, late.surfels()));
  Changes then;
  then.updated = loaded;
  other.apply(then);
  const Changes changes = large.changes(first);
  other.apply(changes);
  EXPECT_TRUE(same(after, other.surfels()));
  EXPECT_LT(changes.updated.size(), after.size() - far + 1);
}

/// A mapper does not make such radii, but a file may contain them: mapping goes on.
TEST(MapperLarge, SurfelsLargerThanTheRoom) {
  const Frames frames = orbit_frames(coarse_camera(), 4, 5);
  for (const float radius : {0.5F, 3.0F, 1e4F, 1e30F}) {
    SCOPED_TRACE("radius " + std::to_string(radius));
    Surfel surfel;
    surfel.radius = radius;
    surfel.position = {0.5F, 0.5F, 1};
    Mapper mapper(undecimated());
    mapper.load(std::vector<Surfel>(3, surfel));
    for (const auto& frame : frames) EXPECT_NO_THROW(mapper.integrate(frame.view()));
    EXPECT_TRUE(all_sound(mapper.surfels()));
    EXPECT_GT(mapper.size(), 10000u);
  }
}

TEST(MapperLarge, AMapOfAnotherWorldIsRefused) {
  Mapper mapper(undecimated());
  integrate_all(mapper, orbit_frames(coarse_camera(), 1));
  const std::vector<Surfel> before = mapper.surfels();
  for (const float far : {2e6F, -1e30F, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    std::vector<Surfel> surfels(2);
    surfels[0].radius = surfels[1].radius = 1;
    surfels[1].position.y() = far;
    EXPECT_NE(fault_of<Error>([&] { mapper.load(surfels); }), "");
    EXPECT_TRUE(same(before, mapper.surfels()));
    EXPECT_EQ(mapper.sequence(), 1u);
    if (!std::isfinite(far)) continue;
    const std::string path = (std::filesystem::temp_directory_path() / ("far_" + std::to_string(getpid()) + ".ply")).string();
    write_ply(path, surfels);
    const std::string said = fault_of<FileError>([&] { mapper.load(path); });
    EXPECT_NE(said.find(path), std::string::npos) << said;
    EXPECT_TRUE(same(before, mapper.surfels()));
    std::filesystem::remove(path);
  }
}

}  // namespace
}  // namespace frontier_surfels
