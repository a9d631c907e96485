#include "replay/live_replay.hpp"

#ifdef FRONTIER_SURFELS_WITH_ROS
#include "replay/bag_live_replay.hpp"
#endif

namespace frontier_surfels::replay {

std::unique_ptr<LiveReplay> open_live_replay(const Recording& recording, const LiveOptions& options, const std::function<bool()>& stop) {
#ifdef FRONTIER_SURFELS_WITH_ROS
  return std::make_unique<BagLiveReplay>(recording, options, stop);
#else
  (void)recording, (void)options, (void)stop;
  throw Error("--live needs ROS, and this was built without: leave it out to replay offline, or build with ROS.");
#endif
}

}  // namespace frontier_surfels::replay
