/// Publishes the map, off the frames' path, and only what somebody listens to.
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
#include "ros/output/surfel_markers.hpp"
#include "ros/output/surfel_mirror.hpp"

namespace frontier_surfels {

/// What is known of the map besides its surfels.
struct MapState {
  ros::Time stamp;    ///< of the last frame
  CameraView camera;  ///< of the last frame, for ~markers
};

/// Changes on their way to the publisher's thread.
struct PushedChanges {
  Changes changes;
  std::uint64_t since = 0;
  MapState state;
};

/// Adds to the queue; neighbours in it are merged where more than `most` would wait.
void enqueue(std::deque<PushedChanges>& queue, PushedChanges pushed, std::size_t most);

/// ~surfels, ~occupied, ~frontier (latched), ~update and ~markers. A thread of its own keeps a copy of the map from the changes it is given
/// and publishes from that. Nobody listens: no changes are asked for, and nothing is done. It falls behind: no changes are asked for until
/// it has caught up, so that it gets fewer and larger ones.
class MapPublisher {
 public:
  /// @param wake  called (from any thread) when changes would be welcome though no frame comes: somebody has begun to listen, or
  ///              wants_changes() was false for a while
  MapPublisher(ros::NodeHandle pnh, const NodeConfig& config, std::function<void()> wake);
  ~MapPublisher();  ///< within the time of one message

  /// Whether to call push() now. To be asked after every frame, reset and load, and when woken: with somebody listening to ~update it is
  /// mostly true, for clouds and markers only where they are due.
  bool wants_changes();

  /// Number of the map that has been pushed last: the next push() must contain the changes since then.
  std::uint64_t sequence() const { return pushed_; }

  /// Hands over the changes since `since`, which is sequence(), or 0: the whole map. Returns at once; what must wait is queued.
  void push(Changes changes, std::uint64_t since, const MapState& state);

 private:
  using Clock = std::chrono::steady_clock;  // a bag's time may stand still
  enum Topic { kSurfels, kOccupied, kFrontier, kUpdate, kMarkers, kTopics };

  bool is_heard(Topic topic) const;
  bool is_welcome() const;
  void on_connect(Topic topic);

  // On the thread
  void run();
  std::deque<PushedChanges> wait();
  void ask_again();
  std::optional<Clock::time_point> next_time() const;
  bool is_stale(Topic topic) const;
  void apply_and_tell(const std::deque<PushedChanges>& queue);
  bool apply(const PushedChanges& pushed, Eigen::AlignedBox3f& box);
  void start_over();
  void publish_what_is_due();
  void publish_cloud(Topic topic);
  void publish_markers();
  template <typename Make>
  void publish(Topic topic, Make make);
  std_msgs::Header header() const;
  sensor_msgs::PointCloud2 with_header(sensor_msgs::PointCloud2 cloud) const;
  SurfelUpdate with_header(SurfelUpdate update) const;

  const std::string world_frame_;
  const Label confident_;  ///< has confidence 1 in clouds
  const Clock::duration period_;
  const std::function<void()> wake_;
  std::array<ros::Publisher, kTopics> publishers_;
  std::array<std::atomic<int>, kTopics> listeners_within_ = {};  ///< of this process
  std::atomic<std::uint64_t> pushed_{0};
  std::atomic<bool> stopping_{false};
  std::atomic<int> thread_id_{0};
  std::atomic<Clock::time_point> next_time_{Clock::time_point()};  ///< of clouds and markers

  std::mutex mutex_;  ///< guards queue_ to connected_; held for moments only, as push() waits for it
  std::condition_variable changed_;
  std::deque<PushedChanges> queue_;
  std::size_t taken_ = 0;                     ///< from the queue, and not done with
  bool refused_ = false;                      ///< wants_changes() was false though somebody listens
  std::array<bool, kTopics> connected_ = {};  ///< by somebody new

  // The thread's own
  SurfelMirror map_;
  SurfelMarkers markers_;
  MapState state_;
  std::uint64_t pushes_ = 0;                      ///< that have been applied
  std::uint64_t version_ = 0;                     ///< counts those that have changed something
  std::array<std::uint64_t, kTopics> sent_ = {};  ///< version_, or for markers pushes_, that has been published last
  std::array<bool, kTopics> at_once_ = {};        ///< somebody new has not been served yet
  bool asks_again_ = false;                       ///< calls wake_ as soon as changes are welcome

  std::thread thread_;
};

}  // namespace frontier_surfels
