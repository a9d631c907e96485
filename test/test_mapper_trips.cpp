/// What a frame asks of the device: each time the host waits, a graphics processor runs dry, and each launch costs some microseconds. A
/// command that is added fails here, and has to be worth it.
#include <gtest/gtest.h>

#include "frontier_surfels/map_checksum.hpp"
#include "mapper_input.hpp"
#include "opencl/fault_injection.hpp"

namespace frontier_surfels {
namespace {

struct Trips {
  std::size_t waits, launches, fills, copies, uploads;
};

Trips last_trips() {
  const auto count = [](Call kind) { return FaultInjection::count(kind); };
  return {count(Call::kWait), count(Call::kLaunch), count(Call::kFill), count(Call::kCopy), count(Call::kUpload)};
}

void expect_at_most(const Trips& trips, const Trips& most) {
  EXPECT_LE(trips.waits, most.waits);
  EXPECT_LE(trips.launches, most.launches);
  EXPECT_LE(trips.fills, most.fills);
  EXPECT_LE(trips.copies, most.copies);
  EXPECT_LE(trips.uploads, most.uploads);
}

/// Frames in which surfels were split, space was taken back, or blocks were added to the memory of seen points take more,
/// and are left out; so are those with many more candidates than the frame before.
/// @return number of frames that were compared
std::size_t compare(const Config& config, const Trips& most) {
  Mapper mapper(config);
  std::size_t compared = 0;
  for (const auto& frame : orbit_frames(coarse_camera(), 16, 1)) {
    FaultInjection::stop();
    const Report report = mapper.integrate(frame.view());
    const Trips trips = last_trips();
    if (report.sequence <= 8 || report.split > 0 || report.taken_back > 0 || report.created == 0) continue;
    SCOPED_TRACE("frame " + std::to_string(report.sequence) + ", lanes " + std::to_string(config.lanes));
    expect_at_most(trips, most);
    ++compared;
  }
  return compared;
}

/// @param timed_every  Config::stage_times_every
Config with_lanes(int lanes, int timed_every = 0) {
  Config config = undecimated();
  config.lanes = lanes;
  config.stage_times_every = timed_every;
  return config;
}

TEST(MapperTrips, OfACpu) { EXPECT_GT(compare(with_lanes(16), {4, 29, 3, 1, 1}), 3u); }

TEST(MapperTrips, OfAGraphicsProcessor) {
  for (const int timed_every : {1, 1000}) EXPECT_GT(compare(with_lanes(1, timed_every), {1, 60, 8, 1, 1}), 3u);
}

/// The host waits twice: for the bricks that the forgotten view sees, and for all the rest. Blocks that are new get tables.
TEST(MapperTrips, OfAGraphicsProcessorThatRemembersAForgottenView) {
  Config config = with_lanes(1);
  config.recent_views = 3;
  EXPECT_GT(compare(config, {2, 66, 8, 2, 2}), 3u);
}

/// Timing costs a graphics processor more than launching; frames without it make the same map.
TEST(MapperTrips, StagesAreTimedInOneFrameOfSoMany) {
  for (const int every : {1, 3}) {
    Config config = undecimated();
    config.stage_times_every = every;
    Mapper mapper(config), reference(undecimated());
    for (const auto& frame : orbit_frames(coarse_camera(), 6, 1)) {
      const Report report = mapper.integrate(frame.view());
      reference.integrate(frame.view());
      EXPECT_EQ(report.stages.empty(), report.sequence % static_cast<std::uint64_t>(every) != 0) << report.sequence;
    }
    EXPECT_EQ(map_checksum(mapper.surfels()), map_checksum(reference.surfels()));
  }
}

}  // namespace
}  // namespace frontier_surfels
