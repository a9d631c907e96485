/// The same frames give the same map, bit by bit.
#include <gtest/gtest.h>

#include <cstdlib>

#include "mapper_input.hpp"
#include "stages/test_device.hpp"

namespace frontier_surfels {
namespace {

// Makes PoCL offer the processor twice, with and without threads. Set before the first call into OpenCL, which reads it.
const int kTwoDevices = setenv("POCL_DEVICES", "pthread basic", 0);

/// Frames that make the pipeline do everything: colour, removals, reused ids, splits, another image size, more views than are kept.
Frames varied_frames() {
  Frames frames = orbit_frames(coarse_camera(), 6, 5);
  const Intrinsics narrow = plain_camera(60, 44, 70);
  for (const double depth : {2.5, 1.6, 1.0, 0.55}) {
    const Eigen::Vector3d forward(0.1, 1, 0);
    frames.push_back(plane_frame(narrow, depth, look_along(Eigen::Vector3d(10, 10, 0) - depth * forward.normalized(), forward)));
  }
  const Frames back = orbit_frames(coarse_camera(), 2, 20);
  frames.insert(frames.end(), back.begin(), back.end());
  return frames;
}

Config few_views() {
  Config config = undecimated();
  config.recent_views = 3;
  return config;
}

struct Reference {
  Frames frames = varied_frames();
  std::vector<Surfel> surfels;
  std::size_t split = 0, removed = 0;

  Reference() {
    Mapper mapper(few_views());
    for (const auto& frame : frames) {
      const Report report = mapper.integrate(frame.view());
      split += report.split;
      removed += report.removed;
    }
    surfels = mapper.surfels();
  }

  static const Reference& instance() {
    static const Reference reference;
    return reference;
  }
};

TEST(MapperDeterminism, TheFramesMakeThePipelineDoEverything) {
  const Reference& reference = Reference::instance();
  EXPECT_GT(reference.split, 0u);
  EXPECT_GT(reference.removed, 0u);
  EXPECT_GT(reference.surfels.size(), 20000u);
  EXPECT_TRUE(all_sound(reference.surfels));
  EXPECT_TRUE(std::any_of(reference.surfels.begin(), reference.surfels.end(), [](const Surfel& s) {
    return s.label == Label::kOccupied && s.rgb != std::array<std::uint8_t, 3>{0, 0, 0};
  }));
}

TEST(MapperDeterminism, FromRunToRun) {
  const Reference& reference = Reference::instance();
  for (int run = 0; run < 3; ++run) EXPECT_TRUE(same(reference.surfels, map_of(reference.frames, few_views()))) << "run " << run;
}

/// Number of the first device that can be divided; -1 if there is none.
int device_with_threads() {
  Config config;
  for (const int devices = static_cast<int>(number_of_devices()); config.device_index < devices; ++config.device_index)
    if (can_be_divided(choose_device(config))) return config.device_index;
  return -1;
}

TEST(MapperDeterminism, ForAnyNumberOfThreads) {
  Config config = few_views();
  config.device_index = device_with_threads();
  if (config.device_index < 0) GTEST_SKIP() << "No device can be divided.";
  const Reference& reference = Reference::instance();
  for (const int threads : {0, 1, 2}) {
    config.threads = threads;
    EXPECT_TRUE(same(reference.surfels, map_of(reference.frames, config))) << threads << " threads";
  }
}

/// The map is the same for work items that handle 16 points as vectors and for items that handle one.
TEST(MapperDeterminism, AtEitherWidth) {
  const Reference& reference = Reference::instance();
  Config paper = load_config(FRONTIER_SURFELS_SOURCE_DIR "/config/paper.yaml");
  paper.decimation = 1;
  for (Config config : {few_views(), paper}) {
    SCOPED_TRACE(std::to_string(config.recent_views) + " views kept");
    config.lanes = 16;
    const std::vector<Surfel> wide = map_of(reference.frames, config);
    config.lanes = 1;
    EXPECT_GT(wide.size(), 20000u);
    EXPECT_TRUE(same(wide, map_of(reference.frames, config)));
  }
}

TEST(MapperDeterminism, MappersDoNotAffectEachOther) {
  const Reference& reference = Reference::instance();
  Mapper one(few_views()), other(few_views());
  const Frames others = orbit_frames(coarse_camera(), 5, 9);
  for (std::size_t n = 0; n < reference.frames.size(); ++n) {
    one.integrate(reference.frames[n].view());
    other.integrate(others[n % others.size()].view());
    if (n == 5) other.reset();
  }
  EXPECT_TRUE(same(reference.surfels, one.surfels()));
  EXPECT_FALSE(same(reference.surfels, other.surfels()));
}

TEST(MapperDeterminism, AMovedMapperGoesOn) {
  const Reference& reference = Reference::instance();
  Mapper first(few_views());
  const std::size_t half = reference.frames.size() / 2;
  for (std::size_t n = 0; n < half; ++n) first.integrate(reference.frames[n].view());
  Mapper second(std::move(first));
  Mapper third(few_views());
  third = std::move(second);
  for (std::size_t n = half; n < reference.frames.size(); ++n) third.integrate(reference.frames[n].view());
  EXPECT_TRUE(same(reference.surfels, third.surfels()));
}

TEST(MapperDeterminism, AResetMapperIsLikeANewOne) {
  const Reference& reference = Reference::instance();
  Mapper mapper(few_views());
  integrate_all(mapper, orbit_frames(coarse_camera(), 3, 30));
  mapper.reset();
  integrate_all(mapper, reference.frames);
  EXPECT_TRUE(same(reference.surfels, mapper.surfels()));
}

TEST(MapperDeterminism, OnASecondDevice) {
  if (number_of_devices() < 2) GTEST_SKIP() << "There is no second device.";
  const Reference& reference = Reference::instance();
  Config config = few_views();
  config.device_index = 1;
  const std::string lacking = fault_of<DeviceError>([&] { choose_device(config); });
  if (lacking.find("choose another one") != std::string::npos) GTEST_SKIP() << lacking;  // the device is too simple for any map
  Mapper mapper(config);
  integrate_all(mapper, reference.frames);
  EXPECT_TRUE(same(reference.surfels, mapper.surfels())) << mapper.device() << " against " << Mapper(few_views()).device();
}

}  // namespace
}  // namespace frontier_surfels
