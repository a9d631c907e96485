/// Publishes the map on a thread of its own. Topics without subscribers cost nothing.
#pragma once

#include <frontier_surfels/SurfelUpdate.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/PointCloud2.h>

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

#include "ros/input/parameters.hpp"
#include "ros/input/warning_throttle.hpp"
#include "ros/output/surfel_markers.hpp"
#include "ros/output/surfel_messages.hpp"
#include "ros/output/surfel_mirror.hpp"

namespace frontier_surfels {

/// What is published of the map besides its surfels.
struct MapState {
  ros::Time stamp;    ///< of the last frame
  CameraView camera;  ///< of the last frame, for ~markers
};

/// Changes that wait for the publisher's thread.
struct PushedChanges {
  Changes changes;
  std::uint64_t since = 0;
  MapState state;
};

/// Adds changes to the queue. If more than `most` would wait then, two that follow each other are merged.
void enqueue(std::deque<PushedChanges>& queue, PushedChanges pushed, std::size_t most);

/// Publishes ~surfels, ~occupied, ~frontier (latched), ~update and ~markers. Its thread keeps a copy of the map, which it updates from the
/// changes that are pushed, and publishes from this copy. Without subscribers it wants no changes. If it falls behind, it wants no changes
/// until it has caught up, and then gets all of them at once.
class MapPublisher {
 public:
  /// @param wake  called from any thread when changes are wanted and no frame may come: there is a new subscriber, or changes were not
  ///              wanted for a while
  MapPublisher(ros::NodeHandle pnh, const NodeConfig& config, std::function<void()> wake);
  ~MapPublisher();  ///< returns after the message that is being made

  /// Whether push() should be called now. Ask after every frame, reset and load, and after every `wake`. While ~update has subscribers the
  /// answer is mostly true; for clouds and markers it is true only when they are due.
  bool wants_changes();

  /// Sequence number of the map that was pushed last. The next push() must contain the changes since then.
  std::uint64_t sequence() const { return pushed_; }

  /// Queues the changes since the number `since`, and returns at once.
  /// @param since  sequence(), or 0 if the changes contain the whole map
  void push(Changes changes, std::uint64_t since, const MapState& state);

 private:
  using Clock = std::chrono::steady_clock;  // not ROS time, which stands still while a bag is paused
  enum Topic { kSurfels, kOccupied, kFrontier, kUpdate, kMarkers, kTopics };

  bool is_heard(Topic topic) const;
  bool is_welcome() const;
  void on_connect(Topic topic);

  // On the publisher's thread
  void run();
  std::deque<PushedChanges> wait();
  void ask_again();
  std::optional<Clock::time_point> next_time() const;
  bool is_stale(Topic topic) const;
  void apply_and_tell(const std::deque<PushedChanges>& queue);
  bool apply(const PushedChanges& pushed, Eigen::AlignedBox3f& box);
  void warn(const std::string& what, const std::exception& fault);
  void start_over();
  void publish_what_is_due();
  void publish_update(messages::UpdateMessages update);
  void publish_cloud(Topic topic);
  void publish_markers();
  template <typename Make>
  void publish(Topic topic, Make make);
  std_msgs::Header header() const;
  sensor_msgs::PointCloud2 with_header(sensor_msgs::PointCloud2 cloud) const;
  SurfelUpdate with_header(SurfelUpdate update) const;

  const std::string world_frame_;
  const Label confident_;           ///< has confidence 1 in clouds
  const std::size_t most_surfels_;  ///< in a message
  const Clock::duration period_;
  const std::function<void()> wake_;
  std::array<ros::Publisher, kTopics> publishers_;
  std::array<std::atomic<int>, kTopics> listeners_within_ = {};  ///< number of subscribers in this process
  std::atomic<std::uint64_t> pushed_{0};
  std::atomic<bool> stopping_{false};
  std::atomic<int> thread_id_{0};
  std::atomic<Clock::time_point> next_time_{Clock::time_point()};  ///< when clouds and markers are due

  std::mutex mutex_;  ///< guards queue_ to connected_; must be held for moments only, because push() waits for it
  std::condition_variable changed_;
  std::deque<PushedChanges> queue_;
  std::size_t taken_ = 0;                     ///< number of changes that the thread is working on
  bool refused_ = false;                      ///< wants_changes() was false although there are subscribers
  std::array<bool, kTopics> connected_ = {};  ///< there is a new subscriber

  // Only used by the thread
  SurfelMirror map_;
  SurfelMarkers markers_;
  MapState state_;
  WarningThrottle warnings_{std::chrono::seconds(5)};
  std::uint64_t pushes_ = 0;                      ///< number of pushes that have been applied
  std::uint64_t version_ = 0;                     ///< number of these that have changed something
  std::array<std::uint64_t, kTopics> sent_ = {};  ///< version_ (for markers: pushes_) that was published last
  std::array<bool, kTopics> at_once_ = {};        ///< a new subscriber has got nothing yet
  bool asks_again_ = false;                       ///< wake_ is to be called as soon as changes are wanted again

  std::thread thread_;
};

}  // namespace frontier_surfels
