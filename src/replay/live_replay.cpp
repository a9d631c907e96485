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
  throw Error("--live needs ROS, but this program was built without ROS: leave out --live to replay offline, or build with ROS.");
#endif
}

}  // namespace frontier_surfels::replay
