/// Replays a recording through the topics of a running mapper node.
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

  /// The configuration of the running mapper.
  virtual const Config& config() const = 0;

  /// Like map_recording(), but sends the frames to the running mapper and takes the map from it. Can be called once only.
  virtual Run map(Yardsticks* yardsticks, const std::function<bool()>& stop) = 0;
};

/// Connects to the running mapper.
/// @param stop    asked while waiting for the mapper: whether to give up
/// @throws Error  says what is missing; also thrown by a build without ROS
std::unique_ptr<LiveReplay> open_live_replay(const Recording& recording, const LiveOptions& options, const std::function<bool()>& stop);

}  // namespace frontier_surfels::replay
