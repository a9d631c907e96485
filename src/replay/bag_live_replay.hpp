/// A LiveReplay that plays bags.
#pragma once

#include <memory>

#include "recordings/bag_source.hpp"
#include "replay/bag_player.hpp"
#include "replay/live_replay.hpp"
#include "ros/client/running_mapper.hpp"

namespace frontier_surfels::replay {

class BagLiveReplay : public LiveReplay {
 public:
  BagLiveReplay(const Recording& recording, const LiveOptions& options, const std::function<bool()>& stop);

  const Config& config() const override { return mapper_->config(); }
  Run map(Yardsticks* yardsticks, const std::function<bool()>& stop) override;

 private:
  /// A frame and the depth message that it was made of.
  struct Played {
    RecordedFrame frame;
    rosbag::MessageInstance message;
    ros::Time stamp;
  };

  void refuse_map_folder() const;
  void open_bag();
  void tell_what_is_not_heard();
  void begin(const Played& first);
  std::unique_ptr<Played> next();
  void send(const Played& played, const ros::Duration& transforms_ahead);
  FrameReport answer_to(const Played& played, double timeout);

  Recording recording_;
  std::unique_ptr<RunningMapper> mapper_;
  std::unique_ptr<BagSource> source_;
  std::unique_ptr<BagPlayer> player_;
};

}  // namespace frontier_surfels::replay
