/// Random but valid input for the tests of stages, with fixed seeds: cameras of awkward sizes, depth images, poses, surfels, bit fields.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "frame/working_image.hpp"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"
#include "reference_field.hpp"

namespace frontier_surfels::reference {

/// Are fewer and smaller cases wanted, for slow implementations of OpenCL (interpreters, checkers)?
inline bool small_tests() {
  const char* value = std::getenv("FRONTIER_SURFELS_TEST_SMALL");
  return value != nullptr && std::string(value) == "1";
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) { return low + (high - low) * (engine_() / 4294967296.0); }
  int whole(int low, int high) { return low + static_cast<int>(engine_() % static_cast<unsigned>(high - low + 1)); }
  bool chance(double probability) { return uniform(0, 1) < probability; }
  std::uint32_t bits() { return engine_(); }

  Eigen::Vector3d direction() {
    Eigen::Vector3d v;
    do {
      v = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    } while (v.norm() > 1 || v.norm() < 0.1);
    return v.normalized();
  }

  /// A pose that differs from the identity by at most `distance` [m] and `angle` [rad].
  Eigen::Isometry3d pose(double distance, double angle) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() = direction() * uniform(0, distance);
    T.linear() = Eigen::AngleAxisd(uniform(0, angle), direction()).toRotationMatrix();
    return T;
  }

 private:
  std::mt19937 engine_;
};

struct CameraSetup {
  std::string name;
  Intrinsics intrinsics;
  Config config;
};

/// A camera whose grid has exactly `layers` layers: z_max lies a little in front of the last layer's centre for any focal length.
inline CameraSetup make_camera(int width, int height, double fx, double fy, int layers, std::array<int, 3> padding = {5, 5, 2}) {
  CameraSetup camera;
  camera.name = std::to_string(width) + " x " + std::to_string(height) + " pixels, " + std::to_string(layers) + " layers";
  camera.intrinsics = {fx, fy, 0.5 * width - 0.43, 0.5 * height - 0.61, width, height};
  camera.config.decimation = 1;
  camera.config.min_gap = 0;  // only the tests of thin gaps set it
  camera.config.padding_i = padding[0];
  camera.config.padding_j = padding[1];
  camera.config.padding_k = padding[2];
  const double f = (fx + fy) / 2;
  camera.config.z_max = camera.config.z_min * std::exp((layers - 1.3 - padding[2] - f) / f);
  return camera;
}

/// Cameras with sizes just below and above whole words (64 layers), tiles (8 x 8 x 32 voxels) and work-groups.
inline std::vector<CameraSetup> cameras() {
  std::vector<CameraSetup> all = {make_camera(7, 5, 10.3, 12.1, 33), make_camera(1, 1, 11.2, 11.2, 31, {1, 1, 1})};
  if (small_tests()) return all;
  all.push_back(make_camera(33, 17, 22.7, 20.1, 64));
  all.push_back(make_camera(33, 17, 22.7, 20.1, 65, {3, 2, 4}));
  all.push_back(make_camera(64, 1, 30.3, 30.9, 97));
  all.push_back(make_camera(40, 30, 39.1, 37.3, 127, {4, 1, 3}));
  all.push_back(make_camera(16, 22, 40, 40, 128, {4, 5, 2}));  // k_min is whole here
  return all;
}

enum class Content { mixed, all_valid, all_invalid };

/// Depths between z_min and z_max. Mixed images also have holes (0) and rays without a surface up to z_max (negative).
inline WorkingImage random_image(const CameraSetup& camera, Content content, Random& random) {
  WorkingImage image;
  image.intrinsics = camera.intrinsics;
  const int width = camera.intrinsics.width, height = camera.intrinsics.height;
  const double z_min = camera.config.z_min, z_max = camera.config.z_max;
  for (int pixel = 0; pixel < width * height; ++pixel) {
    double d = random.uniform(z_min, z_max);
    if (random.chance(0.05)) d = random.chance(0.5) ? z_min : z_max;
    if (content == Content::mixed && random.chance(0.2)) d = -z_max;
    if (content == Content::mixed && random.chance(0.4)) d = 0;
    image.depth.push_back(content == Content::all_invalid ? 0 : static_cast<float>(d));
  }
  return image;
}

/// Each voxel is set with a probability; 0 and 1 give empty and full fields.
inline Field<char> random_field(const Grid& grid, double density, Random& random) {
  Field<char> field(grid, 0);
  for (char& value : field.values) value = random.chance(density);
  return field;
}

}  // namespace frontier_surfels::reference
