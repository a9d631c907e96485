/// A recording mapped by a mapper node that runs already, through its topics.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "replay/run.hpp"

namespace frontier_surfels::replay {

struct LiveOptions {
  std::string mapper = "mapper";           ///< name of the node
  std::vector<std::string> ros_arguments;  ///< name:=value, for ros::init
};

class LiveReplay {
 public:
  virtual ~LiveReplay() = default;

  /// That of the running mapper.
  virtual const Config& config() const = 0;

  /// Like map_recording(), but frames go to the running mapper, and the map comes from there. Once only.
  virtual Run map(Yardsticks* yardsticks, const std::function<bool()>& stop) = 0;
};

/// Connects to the running mapper.
/// @param stop    asked while waiting for it: whether to give up
/// @throws Error  a sentence that says what is missing; also where this was built without ROS
std::unique_ptr<LiveReplay> open_live_replay(const Recording& recording, const LiveOptions& options, const std::function<bool()>& stop);

}  // namespace frontier_surfels::replay
