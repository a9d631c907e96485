/// A device that fails at any of its calls while it carries out a frame's changes before the host knows them.
#include <gtest/gtest.h>

#include "device_faults.hpp"

namespace frontier_surfels {
namespace {

/// At width 1 the device carries out a frame's changes before the host knows them.
Config as_graphics_processor() {
  Config config = undecimated();
  config.lanes = 1;
  return config;
}

class MapperDeviceFaultsAhead : public MapperDeviceFaults {
 protected:
  /// As fail_everywhere(). @param waits  how often the host waits in that frame: once if the device goes on by itself
  static void fail(const Frames& frames, std::size_t at, std::size_t waits, const Report& wanted) {
    const auto mapper = begin(as_graphics_processor(), frames, at);
    FaultInjection::stop();
    mapper->integrate(frames[at].view());
    EXPECT_EQ(FaultInjection::count(Call::kWait), waits);
    fail_everywhere(as_graphics_processor(), frames, at, wanted);
  }
};

TEST_F(MapperDeviceFaultsAhead, AFrameThatRemovesAndCreates) {
  Report wanted;
  wanted.removed = wanted.created = 100;
  fail(orbit_frames(small_camera(), 4, 6), 2, 1, wanted);
}

TEST_F(MapperDeviceFaultsAhead, AFrameThatGivesSpaceBack) {
  Report wanted;
  wanted.removed = 50;
  fail(box_that_goes(), 30, 1, wanted);
}

TEST_F(MapperDeviceFaultsAhead, AFrameThatSplits) {
  Report wanted;
  wanted.split = wanted.created = 1;
  fail(approach(), 2, 7, wanted);
}

TEST_F(MapperDeviceFaultsAhead, ADeviceThatStaysAway) { stay_away(as_graphics_processor(), orbit_frames(small_camera(), 3, 6)); }

/// Pages that the failed frame has filled, and that no block has, are empty after that.
TEST_F(MapperDeviceFaultsAhead, ResetAfterAFrameThatCouldNotBeUndone) {
  const Frames frames = orbit_frames(small_camera(), 3, 6);
  const auto undisturbed = begin(as_graphics_processor(), frames, 2);
  undisturbed->reset();
  undisturbed->integrate(frames[2].view());
  std::size_t refused = 0;
  for (std::size_t n = 30; !HasFailure(); n += 2, ++refused) {
    SCOPED_TRACE("from call " + std::to_string(n) + " on");
    const auto mapper = begin(as_graphics_processor(), frames, 2);
    if (refusal(*mapper, frames[2], n, kForEver).empty()) break;
    FaultInjection::stop();
    mapper->reset();
    EXPECT_TRUE(mapper->surfels().empty());
    mapper->integrate(frames[2].view());
    EXPECT_TRUE(same(mapper->surfels(), undisturbed->surfels()));
    EXPECT_EQ(mapper->size(), mapper->surfels().size());
  }
  EXPECT_GT(refused, 10u);
}

}  // namespace
}  // namespace frontier_surfels
