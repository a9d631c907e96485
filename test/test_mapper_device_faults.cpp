/// A device that fails at any of its calls: the frame is refused with a sentence, the map stays as it was, and the same frame then gives
/// the map that it would have given without the failure.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <functional>
#include <memory>

#include "device_faults.hpp"

namespace frontier_surfels {
namespace {

TEST_F(MapperDeviceFaults, TheFirstFrame) {
  Report wanted;
  wanted.created = 100;
  EXPECT_GT(fail_everywhere(undecimated(), orbit_frames(small_camera(), 2, 6), 0, wanted), 20u);
}

/// The queue of timed frames takes the place of the other one, and may fail in that.
TEST_F(MapperDeviceFaults, TheFirstTimedFrame) {
  Config config = undecimated();
  config.stage_times_every = 2;
  Report wanted;
  wanted.created = 100;
  EXPECT_GT(fail_everywhere(config, orbit_frames(small_camera(), 3, 6), 1, wanted), 20u);
}

/// Out of memory: how much was needed, how much is in use, and how much there is.
TEST_F(MapperDeviceFaults, TheNumbersAreTold) {
  const Frames frames = orbit_frames(small_camera(), 2, 6);
  std::string told;
  for (std::size_t n = 0; n < 100 && told.empty(); ++n) {
    const std::string said = refusal(*begin(undecimated(), frames, 0), frames[0], n, 1);
    if (contains(said, "a buffer of ")) told = said;
  }
  EXPECT_TRUE(contains(told, "failed with CL_MEM_OBJECT_ALLOCATION_FAILURE: the device has too little free memory (a buffer of ")) << told;
  EXPECT_TRUE(contains(told, " MiB is needed, this mapper uses ") && contains(told, " MiB of the device's ")) << told;
  EXPECT_FALSE(contains(told, "uses 0.0 MiB") || contains(told, "device's 0.0 MiB") || contains(told, "of 0.0 MiB")) << told;
  EXPECT_TRUE(contains(told, "raise decimation, lower z_max or recent_views, set map_folder")) << told;
}

/// With surfels that leave and come, kept views alone.
TEST_F(MapperDeviceFaults, AFrameThatRemovesAndCreates) {
  Report wanted;
  wanted.removed = wanted.created = 100;
  fail_everywhere(undecimated(), orbit_frames(small_camera(), 4, 6), 2, wanted);
}

/// What floats there goes.
TEST_F(MapperDeviceFaults, AFrameThatTakesSpaceBack) {
  Report wanted;
  wanted.taken_back = 50;
  fail_everywhere(undecimated(), box_that_goes(), 17, wanted);
}

/// The host does not wait for the evidence then, and does wait in a frame just after one that took space back.
TEST_F(MapperDeviceFaults, AFrameThatGivesSpaceBack) {
  Report wanted;
  wanted.removed = 50;
  fail_everywhere(undecimated(), box_that_goes(), 30, wanted);
  fail_everywhere(undecimated(), box_that_goes(), 20, Report());
}

/// As before, and with known space from the surfels, because views have been forgotten.
TEST_F(MapperDeviceFaults, AFrameThatNeedsKnownSpace) {
  Config config = undecimated();
  config.seen_points = false;
  config.recent_views = 1;
  Report wanted;
  wanted.removed = wanted.created = 1;
  fail_everywhere(config, orbit_frames(small_camera(), 5, 6), 3, wanted);
}

/// Views leave the ring, and become seen points: the first one before the frame that fails, so that the memory is empty until then, or one
/// of several.
TEST_F(MapperDeviceFaults, AFrameAfterOneThatForgetsAView) {
  Config config = undecimated();
  config.recent_views = 3;
  Report wanted;
  wanted.removed = wanted.created = 1;
  for (const std::size_t at : {4u, 6u}) fail_everywhere(config, orbit_frames(small_camera(), 8, 6), at, wanted);
}

/// No view is kept, not even the last one.
TEST_F(MapperDeviceFaults, AFrameAfterOneThatIsNotKept) {
  Config config = undecimated();
  config.recent_views = 0;
  Report wanted;
  wanted.removed = wanted.created = 1;
  fail_everywhere(config, orbit_frames(small_camera(), 5, 6), 3, wanted);
}

TEST_F(MapperDeviceFaults, AFrameThatSplits) {
  Report wanted;
  wanted.split = wanted.created = 1;
  fail_everywhere(undecimated(), approach(), 2, wanted);
}

/// The device fails from some call on, so that the map cannot even be restored. Once the device works again, nothing is lost.
TEST_F(MapperDeviceFaults, ADeviceThatStaysAway) { stay_away(undecimated(), approach()); }

/// load() and reset() when a frame could not be undone.
TEST_F(MapperDeviceFaults, LoadAfterAFrameThatCouldNotBeUndone) {
  const Frames frames = approach();
  const auto undisturbed = begin(undecimated(), frames, 2);
  const std::vector<Surfel> saved = undisturbed->surfels();
  undisturbed->load(saved);
  undisturbed->integrate(frames[3].view());
  for (std::size_t n = 40; !HasFailure(); n += 5) {
    const auto mapper = begin(undecimated(), frames, 2);
    if (refusal(*mapper, frames[2], n, kForEver).empty()) break;
    FaultInjection::stop();
    mapper->load(saved);
    EXPECT_EQ(mapper->surfels().size(), saved.size());
    EXPECT_TRUE(all_sound(mapper->surfels()));
    mapper->integrate(frames[3].view());
    EXPECT_EQ(mapper->surfels().size(), undisturbed->surfels().size());
    mapper->reset();
    EXPECT_TRUE(mapper->surfels().empty());
  }
}

/// A load that fails leaves the map as it was, or says that it is lost. Maps with seen points and kept views, or surfels alone.
TEST_F(MapperDeviceFaults, ALoadThatFails) {
  const Frames frames = orbit_frames(small_camera(), 6, 6);
  Config config = undecimated();
  config.recent_views = 2;
  const auto mapper = begin(config, frames, 5);
  const SavedMap before = mapper->saved_map(), other = begin(config, frames, 4)->saved_map();
  for (const SavedMap& loaded : {other, SavedMap{other.surfels, {}, {}}}) {
    int lost = 0;
    for (std::size_t n = 0;; ++n) {
      SCOPED_TRACE("call " + std::to_string(n));
      FaultInjection::fail(n, 1);
      const std::string said = fault_of<DeviceError>([&] { mapper->load(loaded); });
      FaultInjection::stop();
      if (said.empty()) break;
      const std::string later =
          fault_of<DeviceError>([&] { EXPECT_TRUE(same_memory(mapper->saved_map(), before) && mapper->size() == before.surfels.size()); });
      if (later.empty()) continue;
      ++lost;
      EXPECT_NE(later.find("lost"), std::string::npos) << later;
      EXPECT_EQ(fault_of<DeviceError>([&] { mapper->integrate(frames[5].view()); }), later);
      mapper->load(before);
      EXPECT_TRUE(same_memory(mapper->saved_map(), before));
    }
    EXPECT_GT(lost, 0);
    EXPECT_EQ(mapper->surfels().size(), other.surfels.size());
    if (!loaded.views.empty()) {
      EXPECT_TRUE(same_memory(mapper->saved_map(), other));
    }
    mapper->load(before);
  }
}

/// The surfels' positions, sorted, and what has been seen.
struct Content {
  explicit Content(const Mapper& mapper) : memory(mapper.saved_map()) {
    for (const Surfel& s : memory.surfels) positions.push_back({s.position.x(), s.position.y(), s.position.z()});
    std::sort(positions.begin(), positions.end());
  }

  SavedMap memory;
  std::vector<std::array<float, 3>> positions;
};

testing::AssertionResult same(const Content& a, const Content& b) {
  if (a.positions != b.positions) return testing::AssertionFailure() << "other surfels";
  return same_memory(a.memory, b.memory);
}

/// With a map folder, blocks come and go whole, and what the folder has at the end is the map.
/// @param recent_views  with 1, a view is forgotten when the blocks that it has seen are on disk
void expect_whole_map_folder(int recent_views) {
  const auto folder = std::filesystem::temp_directory_path() / ("device_faults_" + std::to_string(getpid()));
  Config config = undecimated();
  config.recent_views = recent_views;
  const Eigen::Vector3d forward(0, 1, 0);
  Frames frames;
  for (const double along : {0.0, 40.0, 0.0, 40.0, 0.1})
    frames.push_back(plane_frame(small_camera(), 2, look_along(Eigen::Vector3d(along, 0, 0), forward)));
  Mapper plain(config);
  integrate_all(plain, frames);
  const Content expected(plain);
  EXPECT_FALSE(expected.memory.seen.blocks.empty());
  config.eviction_radius = 9;
  config.map_folder = folder.string();
  std::size_t failed = 1;
  for (std::size_t n = 0; failed > 0 && !testing::Test::HasFailure(); n += 7 + n / 7) {
    SCOPED_TRACE("from call " + std::to_string(n) + " on");
    failed = 0;
    std::filesystem::remove_all(folder);
    {
      Mapper mapper(config);
      for (const auto& frame : frames) {
        FaultInjection::fail(n, 2);
        failed += fault_of<DeviceError>([&] { mapper.integrate(frame.view()); }).empty() ? 0 : 1;
        FaultInjection::stop();
        while (mapper.sequence() < static_cast<std::size_t>(&frame - &frames[0]) + 1)
          fault_of<DeviceError>([&] { mapper.integrate(frame.view()); });
      }
      EXPECT_TRUE(same(Content(mapper), expected));
    }
    Mapper again(config);
    EXPECT_TRUE(same(Content(again), expected)) << "the folder has another map";
  }
  std::filesystem::remove_all(folder);
}

TEST_F(MapperDeviceFaults, WithAMapFolder) { expect_whole_map_folder(700); }

TEST_F(MapperDeviceFaults, WithAMapFolderAndFewViews) { expect_whole_map_folder(1); }

}  // namespace
}  // namespace frontier_surfels
