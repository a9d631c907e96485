#include "ros/output/planner_publisher.hpp"

#include <frontier_surfels/FrontierClusterArray.h>
#include <frontier_surfels/StatesUpdate.h>
#include <nav_msgs/OccupancyGrid.h>
#include <ros/console.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <utility>

#include "ros/output/cluster_markers.hpp"
#include "ros/output/planner_messages.hpp"
#include "ros/output/serialized.hpp"

#ifdef FRONTIER_SURFELS_OCTOMAP_MSGS
#include <octomap_msgs/Octomap.h>
#endif

namespace frontier_surfels {
namespace {

/// Clusters look for viewpoints in the grid.
class GridSpace : public Space {
 public:
  explicit GridSpace(const StateGrid& grid) : grid_(grid) {}
  bool is_free(const Eigen::Vector3f& p_world) const override { return grid_.state(p_world) == SpaceState::kFree; }
  float clearance(const Eigen::Vector3f& p_world, float most) const override { return grid_.clearance(p_world, most); }
  bool sees(const Eigen::Vector3f& from_world, const Eigen::Vector3f& to_world) const override {
    return grid_.ray_state({from_world, to_world}, true).state == SpaceState::kFree;
  }

 private:
  const StateGrid& grid_;
};

ClusterConfig cluster_config(const NodeConfig& config) {
  ClusterConfig clusters;
  clusters.min_area = config.cluster_min_area;
  clusters.max_extent = config.cluster_max_extent;
  clusters.view_distance = config.view_distance;
  clusters.clearance = config.view_clearance;
  return clusters;
}

}  // namespace

PlannerPublisher::PlannerPublisher(ros::NodeHandle pnh, const NodeConfig& config, std::function<void()> wake)
    : config_(config),
      period_(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(config.planner_period))),
      wake_(std::move(wake)),
      grid_(config.planner_resolution),
      space_(config.planner_resolution),
      clusters_(cluster_config(config)),
      octomap_(config.planner_resolution) {
  advertise<StatesUpdate>(pnh, kStates, "states_update", false);
  advertise<FrontierClusterArray>(pnh, kClusters, "clusters", true);
  advertise<visualization_msgs::MarkerArray>(pnh, kClusterMarkers, "cluster_markers", true);
#ifdef FRONTIER_SURFELS_OCTOMAP_MSGS
  advertise<octomap_msgs::Octomap>(pnh, kOctomap, "octomap_full", true);
#endif
  advertise<nav_msgs::OccupancyGrid>(pnh, kProjected, "projected_map", true);
  thread_ = std::thread([this] { run(); });
}

template <typename Message>
void PlannerPublisher::advertise(ros::NodeHandle& pnh, Topic topic, const char* name, bool latch) {
  constexpr std::uint32_t kQueue = 10;  // messages for a slow subscriber
  publishers_[topic] = pnh.advertise<Message>(
      name, kQueue, [this, topic](const ros::SingleSubscriberPublisher&) { on_connect(topic); }, {}, {}, latch);
}

PlannerPublisher::~PlannerPublisher() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
  for (ros::Publisher& publisher : publishers_) publisher.shutdown();  // ends the callbacks
}

void PlannerPublisher::on_connect(Topic topic) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (stopping_) return;
    connected_[topic] = true;
    next_time_ = {};
  }
  changed_.notify_all();
  wake_();
}

bool PlannerPublisher::wants_changes() {
  if (std::none_of(publishers_.begin(), publishers_.end(), [](const ros::Publisher& p) { return p && p.getNumSubscribers() > 0; }))
    return false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!busy_ && queue_.empty() && Clock::now() >= next_time_) return true;
    refused_ = true;
  }
  changed_.notify_all();
  return false;
}

bool PlannerPublisher::wants_surfels() const { return is_heard(kClusters) || is_heard(kClusterMarkers); }

std::uint64_t PlannerPublisher::sequence() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return grid_.sequence();
}

void PlannerPublisher::push(StateChanges states, std::optional<Changes> surfels, const ros::Time& stamp) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    StateChanges different = grid_.take(std::move(states));
    if (surfels) surfel_sequence_ = surfels->sequence;
    queue_.push_back({std::move(different), std::move(surfels), stamp});
    next_time_ = Clock::now() + period_;
  }
  changed_.notify_all();
}

StateChanges PlannerPublisher::whole_grid() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return grid_.whole();
}

void PlannerPublisher::run() {
  while (!stopping_) {
    try {
      publish(wait());
    } catch (const std::exception& fault) {
      if (warnings_.due(fault.what(), WarningThrottle::Clock::now()) > 0) ROS_WARN("Planners miss something: %s", fault.what());
      clusters_ = FrontierClusters(cluster_config(config_));
      surfel_sequence_ = 0;  // the next push brings the whole map
    }
  }
}

/// Waits until there is something to do, and meanwhile asks for the changes that were refused because they came too early.
/// @return what has been pushed
std::deque<PlannerPublisher::Pushed> PlannerPublisher::wait() {
  std::deque<Pushed> queue;
  std::unique_lock<std::mutex> lock(mutex_);
  busy_ = false;
  const auto called = [this] {
    return stopping_ || !queue_.empty() || std::find(connected_.begin(), connected_.end(), true) != connected_.end();
  };
  while (!called()) {
    if (!refused_) {
      changed_.wait(lock);
    } else if (Clock::now() < next_time_) {
      changed_.wait_until(lock, next_time_);
    } else {
      refused_ = false;
      lock.unlock();
      wake_();
      lock.lock();
    }
  }
  queue.swap(queue_);
  busy_ = true;
  for (std::size_t topic = 0; topic < kTopics; ++topic) at_once_[topic] = at_once_[topic] || connected_[topic];
  connected_ = {};
  return queue;
}

void PlannerPublisher::publish(std::deque<Pushed> queue) {
  if (!queue.empty()) stamp_ = queue.back().stamp;
  for (const Pushed& pushed : queue)
    if (!space_.apply(pushed.states)) space_.apply(whole_grid());
  publish_states(queue);
  publish_clusters(queue);
  publish_octomap(queue);
  publish_projected();
}

/// Whether a message must be made: somebody listens who has not got this map.
bool PlannerPublisher::is_due(Topic topic) {
  const bool at_once = std::exchange(at_once_[topic], false);
  if (stopping_ || !is_heard(topic) || space_.sequence() == 0 || (sent_[topic] == space_.sequence() && !at_once)) return false;
  sent_[topic] = space_.sequence();
  return true;
}

/// If there is a new subscriber, the whole grid, which serves the older ones as well.
void PlannerPublisher::publish_states(const std::deque<Pushed>& queue) {
  const bool whole = at_once_[kStates];
  if (!is_due(kStates)) return;
  const auto send = [this](const StateChanges& changes) {
    StatesUpdate message = messages::to_message(changes);
    message.header = header();
    publishers_[kStates].publish(serialized(message));
  };
  if (whole) return send(space_.whole());
  for (const Pushed& pushed : queue) send(pushed.states);
}

void PlannerPublisher::publish_clusters(std::deque<Pushed>& queue) {
  bool changed = false;
  for (Pushed& pushed : queue)
    if (pushed.surfels) {
      clusters_.apply(*pushed.surfels);
      changed = true;
    }
  if (changed) {
    const ClusterChanges changes = clusters_.update(GridSpace(space_));
    for (const Cluster& cluster : changes.updated) clusters_changed_.push_back(cluster.id);
    clusters_removed_.insert(clusters_removed_.end(), changes.removed.begin(), changes.removed.end());
  }
  if (clusters_.sequence() == 0) return;
  if (is_due(kClusters)) {
    FrontierClusterArray message;
    message.header = header();
    message.sequence = clusters_.sequence();
    for (const Cluster& cluster : clusters_.clusters()) message.clusters.push_back(messages::to_message(cluster));
    std::sort(clusters_changed_.begin(), clusters_changed_.end());
    clusters_changed_.erase(std::unique(clusters_changed_.begin(), clusters_changed_.end()), clusters_changed_.end());
    message.changed = std::exchange(clusters_changed_, {});
    message.removed = std::exchange(clusters_removed_, {});
    publishers_[kClusters].publish(serialized(message));
  }
  if (is_due(kClusterMarkers)) publishers_[kClusterMarkers].publish(serialized(cluster_markers(header(), clusters_.clusters())));
}

/// The tree follows the grid while somebody listens.
void PlannerPublisher::publish_octomap([[maybe_unused]] const std::deque<Pushed>& queue) {
#ifdef FRONTIER_SURFELS_OCTOMAP_MSGS
  if (!is_due(kOctomap)) return;
  for (const Pushed& pushed : queue)
    if (pushed.states.since == octomap_.sequence()) octomap_.apply(pushed.states);
  if (octomap_.sequence() != space_.sequence()) octomap_.apply(space_.whole());
  if (octomap_.empty()) return;  // OctoMap cannot read a tree without nodes
  octomap_msgs::Octomap message;
  message.header = header();
  message.binary = false;
  message.id = "OcTree";
  message.resolution = config_.planner_resolution;
  const std::string data = octomap_.full_data();
  message.data.assign(data.begin(), data.end());
  publishers_[kOctomap].publish(serialized(message));
#endif
}

void PlannerPublisher::publish_projected() {
  if (!is_due(kProjected)) return;
  nav_msgs::OccupancyGrid message = messages::projected(space_, config_.projected_min_z, config_.projected_max_z);
  message.header = header();
  message.info.map_load_time = stamp_;
  publishers_[kProjected].publish(serialized(message));
}

std_msgs::Header PlannerPublisher::header() const {
  std_msgs::Header header;
  header.stamp = stamp_;
  header.frame_id = config_.world_frame;
  return header;
}

}  // namespace frontier_surfels
