/// Publishes what planners follow, on a thread of its own: the grid of states, clusters of frontier surfels, and bridges to other maps.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "frontier_surfels/planner/clusters.hpp"
#include "frontier_surfels/planner/state_grid.hpp"
#include "frontier_surfels/types.hpp"
#include "ros/input/parameters.hpp"
#include "ros/input/warning_throttle.hpp"
#include "ros/output/octomap_bridge.hpp"

namespace frontier_surfels {

/// Publishes ~states_update, ~clusters, ~cluster_markers, ~octomap_full and ~projected_map. What nobody hears is not made.
///
/// The mapping thread pushes the blocks of the grid that may have changed, every `planner_period`. What of them is different goes to the
/// publisher's thread, which has a grid of its own: clusters look for viewpoints in it while mapping goes on.
class PlannerPublisher {
 public:
  /// @param wake  called from any thread when there is a new subscriber, for the case that no frame comes
  PlannerPublisher(ros::NodeHandle pnh, const NodeConfig& config, std::function<void()> wake);
  ~PlannerPublisher();  ///< returns after the message that is being made

  /// Whether push() should be called now. To be asked after every frame, reset and load, and after every `wake`.
  bool wants_changes();
  bool wants_surfels() const;  ///< whether push() needs surfels as well

  /// Sequence numbers of what was pushed last. The next push() must contain the changes since then.
  std::uint64_t sequence() const;
  std::uint64_t surfel_sequence() const { return surfel_sequence_; }

  /// Takes what may have changed, and returns at once.
  /// @throws Error  the grid would become absurdly large
  void push(StateChanges states, std::optional<Changes> surfels, const ros::Time& stamp);

  /// The whole grid as it was published last; its sequence is 0 if there is none.
  StateChanges whole_grid() const;

 private:
  using Clock = std::chrono::steady_clock;
  enum Topic { kStates, kClusters, kClusterMarkers, kOctomap, kProjected, kTopics };

  struct Pushed {
    StateChanges states;  ///< what is different
    std::optional<Changes> surfels;
    ros::Time stamp;
  };

  template <typename Message>
  void advertise(ros::NodeHandle& pnh, Topic topic, const char* name, bool latch);
  void on_connect(Topic topic);
  bool is_heard(Topic topic) const { return publishers_[topic] && publishers_[topic].getNumSubscribers() > 0; }

  // On the publisher's thread
  void run();
  std::deque<Pushed> wait();
  void publish(std::deque<Pushed> queue);
  void publish_states(const std::deque<Pushed>& queue);
  void publish_clusters(std::deque<Pushed>& queue);
  void publish_octomap(const std::deque<Pushed>& queue);
  void publish_projected();
  bool is_due(Topic topic);
  std_msgs::Header header() const;

  const NodeConfig config_;
  const Clock::duration period_;
  const std::function<void()> wake_;
  std::array<ros::Publisher, kTopics> publishers_;
  std::atomic<std::uint64_t> surfel_sequence_{0};
  std::atomic<bool> stopping_{false};

  mutable std::mutex mutex_;  ///< guards what follows; held for moments only, because push() waits for it
  std::condition_variable changed_;
  StateGrid grid_;  ///< as it is published
  std::deque<Pushed> queue_;
  bool busy_ = false;     ///< the thread works
  bool refused_ = false;  ///< wants_changes() was false although there are subscribers
  Clock::time_point next_time_ = {};
  std::array<bool, kTopics> connected_ = {};

  // Only used by the thread
  StateGrid space_;  ///< of the clusters
  FrontierClusters clusters_;
  OctomapBridge octomap_;
  std::vector<std::uint32_t> clusters_changed_, clusters_removed_;
  std::array<bool, kTopics> at_once_ = {};        ///< a new subscriber has got nothing yet
  std::array<std::uint64_t, kTopics> sent_ = {};  ///< sequence number of what was published last
  ros::Time stamp_;
  WarningThrottle warnings_{std::chrono::seconds(5)};

  std::thread thread_;
};

}  // namespace frontier_surfels
