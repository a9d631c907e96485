/// kernels/stages/1_observed_space.cl compared with a literal loop over pixels and layers.

#include <gtest/gtest.h>

#include "stages/frame_fixture.hpp"
#include "stages/observed_space.hpp"
#include "stages/reference_observed_space.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

void check(const CameraSetup& camera, const WorkingImage& image) {
  FrameFixture fixture(camera.config);
  fixture.begin(image, Eigen::Isometry3d::Identity());
  ObservedSpace observed(fixture.commands());
  observed.compute(fixture.camera());
  const Nuvg grid(camera.intrinsics, camera.config);
  ASSERT_EQ(fixture.grid().size_i, grid.size_i);
  ASSERT_EQ(fixture.grid().size_j, grid.size_j);
  ASSERT_EQ(fixture.grid().size_k, grid.size_k);
  expect_equal("C~", observed_space(grid, image, fixture.layer_depth()), fixture.read(observed.bits()));
}

TEST(StageObservedSpace, LayerDepths) {
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Random random(1);
    FrameFixture fixture(camera.config);
    fixture.begin(random_image(camera, Content::mixed, random), Eigen::Isometry3d::Identity());
    const Nuvg grid(camera.intrinsics, camera.config);
    const auto depths = fixture.layer_depth();
    for (int k = 0; k < grid.size_k; ++k) EXPECT_NEAR(depths[k], grid.center_of(0, 0, k).z(), 1e-6) << "layer " << k;
  }
}

TEST(StageObservedSpace, RandomImages) {
  for (const CameraSetup& camera : cameras()) {
    for (const Content content : {Content::mixed, Content::all_valid, Content::all_invalid}) {
      SCOPED_TRACE(camera.name + ", content " + std::to_string(static_cast<int>(content)));
      Random random(2);
      check(camera, random_image(camera, content, random));
    }
  }
}

TEST(StageObservedSpace, OneValidPixelAtATime) {
  const CameraSetup camera = cameras().front();
  const int pixels = camera.intrinsics.width * camera.intrinsics.height;
  for (int pixel = 0; pixel < pixels; ++pixel) {
    SCOPED_TRACE("pixel " + std::to_string(pixel));
    Random random(pixel);
    WorkingImage image = random_image(camera, Content::all_invalid, random);
    image.depth[pixel] = 0.9F;
    check(camera, image);
  }
}

/// Rows of pixels with several words, and with more than a work-group has at a time.
TEST(StageObservedSpace, WideImages) {
  for (const int width : {100, 1100}) {
    const CameraSetup camera = make_camera(width, 2, 40.3, 40.1, 65);
    SCOPED_TRACE(camera.name);
    Random random(4);
    check(camera, random_image(camera, Content::mixed, random));
    for (int n = 0; n < (small_tests() ? 1 : 20); ++n) {
      WorkingImage image = random_image(camera, Content::all_invalid, random);
      for (int valid = 0; valid < 10; ++valid) image.depth[random.whole(0, static_cast<int>(image.depth.size()) - 1)] = 0.9F;
      check(camera, image);
    }
  }
}

/// z(k) < d is strict: a depth exactly at a layer's centre does not observe that layer.
TEST(StageObservedSpace, DepthsExactlyAtLayers) {
  for (const CameraSetup& camera : cameras()) {
    SCOPED_TRACE(camera.name);
    Random random(3);
    WorkingImage image = random_image(camera, Content::all_valid, random);
    FrameFixture fixture(camera.config);
    fixture.begin(image, Eigen::Isometry3d::Identity());
    const std::vector<float> depths = fixture.layer_depth();
    for (float& d : image.depth) {
      const int k = random.whole(fixture.grid().first_pyramid_layer, fixture.grid().size_k - 1);
      d = std::nextafter(depths[k], depths[k] + static_cast<float>(random.whole(-1, 1)));
    }
    check(camera, image);
  }
}

}  // namespace
}  // namespace frontier_surfels
