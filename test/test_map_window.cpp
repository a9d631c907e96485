/// The window of a view: for any camera and pose it contains every block with a surfel that may reach into the grid.

#include <gtest/gtest.h>

#include <set>

#include "map/map_window.hpp"
#include "stages/frame_fixture.hpp"
#include "stages/reference_surfels.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

/// Finds the centre (grid coordinates) of a surfel whose ellipsoid contains a point (grid coordinates). Iterates, because the ellipsoid's
/// shape depends on the position of its centre.
/// @param r       radius [m]
/// @param normal  camera frame
/// @param along   distance between centre and point along the normal, in units of the thickness
/// @param across  offset between centre and point in the disc, in units of its reach
/// @return whether there is such a centre
bool center_around(const Nuvg& grid, double thickness, const Vector3d& point, double r, const Vector3d& normal, double along,
                   const Vector3d& across, Vector3d* center) {
  *center = point;
  for (int n = 0; n < 200; ++n) {
    const Vector3d p = grid.from_grid(*center);
    const Vector3d ray = p.z() >= grid.z_min ? Vector3d(p / p.z()) : Vector3d(0, 0, 1);
    const Vector3d u = along * thickness * normal + 2 * r / grid.voxel_size(p.z()) * across;
    const Vector3d next =
        point - Vector3d(u.x() - (p.z() >= grid.z_min ? ray.x() : 0) * u.z(), u.y() - (p.z() >= grid.z_min ? ray.y() : 0) * u.z(), u.z());
    if ((next - *center).norm() < 1e-6) return true;
    *center = 0.5 * (*center + next);
  }
  return false;
}

/// A point in the grid or one voxel beside it, often exactly on that border.
Vector3d point_of_grid(const Nuvg& grid, Random& random) {
  const double sizes[] = {double(grid.size_i), double(grid.size_j), double(grid.size_k)};
  Vector3d point;
  for (int axis = 0; axis < 3; ++axis) {
    point[axis] = random.uniform(-1, sizes[axis]);
    if (random.chance(0.5)) point[axis] = random.chance(0.5) ? -1 : sizes[axis];
  }
  return point;
}

struct Tally {
  int surfels = 0;
  double met = 0, cells = 0;
};

/// @param largest  largest radius of the map's surfels [m]; 0: the largest radius of surfels that this view creates
void check(const CameraSetup& camera, const Eigen::Isometry3d& T_world_camera, double largest, Random& random, Tally& tally) {
  const Nuvg grid(camera.intrinsics, camera.config);
  FrameFixture fixture(camera.config);
  if (largest > 0) {
    Surfel surfel;
    surfel.radius = static_cast<float>(largest);
    fixture.map().replace({surfel}, 1);
  } else {
    largest = std::sqrt(3.0) / 2 * grid.voxel_size(grid.from_grid(Vector3d(0, 0, grid.size_k - 1)).z());
  }
  fixture.begin(random_image(camera, Content::all_invalid, random), T_world_camera);
  const MapWindow& window = fixture.map().window();
  const Window& w = window.window();
  const double block_size = block_size_for(camera.config.z_max);
  EXPECT_EQ(w.block_size, block_size);
  for (int n = 0; n < (small_tests() ? 200 : 3000); ++n) {
    const bool across_view = random.chance(0.3);
    const Vector3d normal = across_view ? Vector3d::UnitZ() : random.direction(), across = random.direction();
    const Vector3d in_disc = (across - across.dot(normal) * normal).normalized();
    const double angle = random.uniform(0, 2 * M_PI), r = random.chance(0.5) ? largest : random.uniform(0, largest);
    Vector3d center;
    if (!center_around(grid, camera.config.thickness, point_of_grid(grid, random), r, normal, std::cos(angle), std::sin(angle) * in_disc,
                       &center))
      continue;
    // Surfels in the grid reach at most 7 voxels. Much larger ones beyond it are distorted so strongly that the test means nothing, except
    // for surfels that lie across the view.
    constexpr double kLargest = 12;
    const Vector3d p_camera = grid.from_grid(center);
    if (!across_view && 2 * r > kLargest * grid.voxel_size(p_camera.z())) continue;
    ++tally.surfels;
    const Vector3d p = T_world_camera * p_camera;
    const BlockKey block = block_of(p.cast<float>(), block_size);
    const int x = block.x - w.origin_x, y = block.y - w.origin_y, z = block.z - w.origin_z;
    const bool inside = x >= 0 && y >= 0 && z >= 0 && x < w.size_x && y < w.size_y && z < w.size_z;
    ASSERT_TRUE(inside) << "a surfel of radius " << r << " m at " << center.transpose();
    ASSERT_TRUE(window.block((z * w.size_y + y) * w.size_x + x) == block);
    ASSERT_TRUE(window.meets_grid(block)) << "a surfel of radius " << r << " m at " << center.transpose();
  }
  for (int cell = 0; cell < window.cells(); ++cell) tally.met += window.meets_grid(window.block(cell));
  tally.cells += window.cells();
}

TEST(MapWindow, HasEveryBlockThatReachesIntoTheGrid) {
  Tally tally;
  Random random(1);
  std::vector<CameraSetup> all = cameras();
  all.push_back(make_camera(200, 100, 130, 130, 200));  // a wide cuboid in front of the pyramid, and fine voxels
  all.back().config.z_min = 1.8;
  all.back().config.z_max = 3;
  for (const CameraSetup& camera : all)
    for (const double largest : {0.0, 0.05, 0.4})
      for (int n = 0; n < 5; ++n) {
        SCOPED_TRACE(camera.name + ", radius " + std::to_string(largest) + " m");
        Eigen::Isometry3d T_world_camera = random.pose(1000, 3.1);
        if (n == 0) T_world_camera.linear().setIdentity();
        check(camera, T_world_camera, largest, random, tally);
      }
  EXPECT_GT(tally.surfels, 5000) << "nothing was tested";
  EXPECT_LT(tally.met, 0.9 * tally.cells) << "too few blocks in the window's corners are left out";
}

/// Floats hold these rotations and translations exactly, so the camera's pose in the local frame must be the same bit by bit.
TEST(MapWindow, IsTheSameAnywhere) {
  const CameraSetup camera = cameras().front();
  Random random(2);
  Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
  here.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  here.translation() = Vector3d(0.3125, -7.75, 1.125);
  FrameFixture fixture(camera.config);
  const WorkingImage image = random_image(camera, Content::all_invalid, random);
  fixture.begin(image, here);
  const MapWindow first = fixture.map().window();
  for (const Vector3d& shift : {Vector3d(4096, -8192, 512), Vector3d(-50000, 49999.5, 3)}) {
    fixture.begin(image, Eigen::Translation3d(shift) * here);
    const MapWindow& window = fixture.map().window();
    EXPECT_TRUE(window.T_camera_local().matrix() == first.T_camera_local().matrix());
    ASSERT_EQ(window.cells(), first.cells());
    for (int cell = 0; cell < first.cells(); ++cell) {
      const BlockKey a = first.block(cell), b = window.block(cell);
      const int blocks[] = {b.x - a.x, b.y - a.y, b.z - a.z};
      for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(blocks[axis], 2 * shift[axis]);
      EXPECT_EQ(first.meets_grid(a), window.meets_grid(b));
    }
  }
}

/// A frame must get the same blocks from blocks_near() and from is_near().
TEST(MapWindow, BlocksNearAndIsNearAgree) {
  Random random(3);
  const CameraSetup camera = cameras().front();
  FrameFixture fixture(camera.config);
  fixture.begin(random_image(camera, Content::all_invalid, random), random.pose(100, 3.1));
  const MapWindow& window = fixture.map().window();
  const Window& w = window.window();
  for (const double distance : {0.0, 0.2, 0.5, 2.9, 3.0, 3.1}) {
    std::set<BlockKey> near;
    constexpr int kMore = 10;  // blocks
    for (int z = -kMore; z < w.size_z + kMore; ++z)
      for (int y = -kMore; y < w.size_y + kMore; ++y)
        for (int x = -kMore; x < w.size_x + kMore; ++x) {
          const BlockKey block = {w.origin_x + x, w.origin_y + y, w.origin_z + z};
          if (window.is_near(block, distance)) near.insert(block);
        }
    const std::vector<BlockKey> listed = window.blocks_near(distance, near.size());
    EXPECT_EQ(std::set<BlockKey>(listed.begin(), listed.end()), near) << distance << " m";
    EXPECT_EQ(listed.size(), near.size());
    EXPECT_TRUE(window.blocks_near(distance, near.size() - 1).empty());
  }
}

TEST(MapWindow, BlocksSuitTheRange) {
  for (const double z_max : {0.02, 3.0, 12.0, 12.1, 100.0, 1000.0}) {
    const double size = block_size_for(z_max);
    EXPECT_EQ(std::exp2(std::round(std::log2(size))), size) << "a power of two";
    EXPECT_LE(z_max, 24 * size);
    EXPECT_TRUE(size == 0.5 || z_max > 12 * size);
  }
}

}  // namespace
}  // namespace frontier_surfels
