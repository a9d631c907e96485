#include "ros/output/map_publisher.hpp"

#include <ros/console.h>
#include <ros/single_subscriber_publisher.h>
#include <ros/this_node.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <utility>

#include "ros/output/serialized.hpp"
#include "ros/output/surfel_messages.hpp"

namespace frontier_surfels {
namespace {

constexpr std::size_t kMostWaiting = 4;                                           // pushes; beyond that, none are wanted
constexpr std::uint32_t kUpdatesQueue = 50, kMarkersQueue = 20, kCloudQueue = 1;  // messages for a slow subscriber
constexpr int kNiceness = 10;                                                     // mapping comes first
constexpr double kShare = 0.1;  // of a core, at most, for publishing; sending and receiving a large map take as much again

/// Sets the niceness of one thread, which only Linux can. If it is refused, nothing is lost.
void set_niceness(int thread_id, int niceness) { setpriority(PRIO_PROCESS, static_cast<id_t>(thread_id), niceness); }

/// CPU time of the calling thread [s].
double cpu_time() {
  timespec time = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// Whether a subscriber is in this process, like another nodelet of the same manager.
bool is_within(const ros::SingleSubscriberPublisher& link) { return link.getSubscriberName() == ros::this_node::getName(); }

std::size_t size(const PushedChanges& pushed) { return pushed.changes.updated.size() + pushed.changes.removed.size(); }

}  // namespace

void enqueue(std::deque<PushedChanges>& queue, PushedChanges pushed, std::size_t most) {
  if (pushed.since == 0) queue.clear();  // a whole map makes everything before it useless
  queue.push_back(std::move(pushed));
  if (queue.size() <= most) return;
  // Merging the two smallest neighbours copies every surfel only a few times, however long nothing is taken from the queue.
  std::size_t first = 0;
  for (std::size_t i = 1; i + 1 < queue.size(); ++i)
    if (size(queue[i]) + size(queue[i + 1]) < size(queue[first]) + size(queue[first + 1])) first = i;
  PushedChanges &earlier = queue[first], &later = queue[first + 1];
  later.changes = merge(std::move(earlier.changes), std::move(later.changes));
  later.since = earlier.since;
  queue.erase(queue.begin() + static_cast<std::ptrdiff_t>(first));
}

MapPublisher::MapPublisher(ros::NodeHandle pnh, const NodeConfig& config, std::function<void()> wake)
    : world_frame_(config.world_frame),
      confident_(config.confident_label()),
      most_surfels_(static_cast<std::size_t>(config.message_limit)),
      period_(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(config.publish_period))),
      wake_(std::move(wake)),
      markers_(config.world_frame, static_cast<std::size_t>(config.marker_limit)) {
  const auto connect = [this](Topic topic) {
    return ros::SubscriberStatusCallback([this, topic](const ros::SingleSubscriberPublisher& link) {
      if (is_within(link)) ++listeners_within_[topic];
      on_connect(topic);
    });
  };
  const auto disconnect = [this](Topic topic) {
    return ros::SubscriberStatusCallback([this, topic](const ros::SingleSubscriberPublisher& link) {
      if (is_within(link)) --listeners_within_[topic];
    });
  };
  const std::pair<Topic, const char*> clouds[] = {{kSurfels, "surfels"}, {kOccupied, "occupied"}, {kFrontier, "frontier"}};
  for (const auto& [topic, name] : clouds)
    publishers_[topic] = pnh.advertise<sensor_msgs::PointCloud2>(name, kCloudQueue, connect(topic), disconnect(topic), {}, true);
  publishers_[kUpdate] = pnh.advertise<SurfelUpdate>("update", kUpdatesQueue, connect(kUpdate), disconnect(kUpdate));
  publishers_[kMarkers] = pnh.advertise<visualization_msgs::MarkerArray>("markers", kMarkersQueue, connect(kMarkers), disconnect(kMarkers));
  thread_ = std::thread([this] { run(); });
}

MapPublisher::~MapPublisher() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_id_ != 0) set_niceness(thread_id_, 0);  // if it is allowed to: mapping has ended, and the process waits for this thread
  thread_.join();
  for (ros::Publisher& publisher : publishers_) publisher.shutdown();  // ends the callbacks
}

bool MapPublisher::is_heard(Topic topic) const { return publishers_[topic].getNumSubscribers() > 0; }

/// Whether changes are wanted. To be called with mutex_ locked.
bool MapPublisher::is_welcome() const {
  if (is_heard(kUpdate)) return queue_.size() + taken_ < kMostWaiting;
  return queue_.empty() && taken_ == 0 && Clock::now() >= next_time_.load();
}

bool MapPublisher::wants_changes() {
  if (std::none_of(publishers_.begin(), publishers_.end(), [](const ros::Publisher& p) { return p.getNumSubscribers() > 0; })) return false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_welcome()) return true;
    refused_ = true;
  }
  changed_.notify_all();
  return false;
}

void MapPublisher::push(Changes changes, std::uint64_t since, const MapState& state) {
  const std::uint64_t sequence = changes.sequence;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (since != 0 && since != pushed_) return;  // start_over() was called meanwhile: the next push is the whole map
    try {
      enqueue(queue_, {std::move(changes), since, state}, kMostWaiting);
    } catch (...) {
      queue_.clear();
      pushed_ = 0;
      throw;
    }
    pushed_ = sequence;
  }
  changed_.notify_all();
}

void MapPublisher::on_connect(Topic topic) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (stopping_) return;
    connected_[topic] = true;
  }
  changed_.notify_all();
  wake_();
}

void MapPublisher::run() {
  thread_id_ = static_cast<int>(syscall(SYS_gettid));
  set_niceness(thread_id_, kNiceness);
  while (!stopping_) {
    try {
      const std::deque<PushedChanges> queue = wait();
      apply_and_tell(queue);
      publish_what_is_due();
      ask_again();
    } catch (const std::exception& fault) {
      warn("Publishing the map failed and is tried again: ", fault);
      start_over();  // changes may have been lost
    }
  }
}

/// Waits until there is something to do. @return what has been pushed
std::deque<PushedChanges> MapPublisher::wait() {
  const std::optional<Clock::time_point> time = next_time();
  std::deque<PushedChanges> queue;
  std::unique_lock<std::mutex> lock(mutex_);
  const auto called = [this] {
    return stopping_ || refused_ || !queue_.empty() || std::find(connected_.begin(), connected_.end(), true) != connected_.end();
  };
  if (time)
    changed_.wait_until(lock, *time, called);
  else
    changed_.wait(lock, called);
  queue.swap(queue_);
  taken_ = queue.size();
  asks_again_ = asks_again_ || refused_;
  refused_ = false;
  for (std::size_t topic = 0; topic < kTopics; ++topic) at_once_[topic] = at_once_[topic] || connected_[topic];
  connected_ = {};
  return queue;
}

/// Asks for the changes that wants_changes() refused, if they are wanted now.
void MapPublisher::ask_again() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    taken_ = 0;
    if (!asks_again_ || !is_welcome()) return;
  }
  asks_again_ = false;
  wake_();
}

/// When something will be due; empty if nothing will.
std::optional<MapPublisher::Clock::time_point> MapPublisher::next_time() const {
  for (const Topic topic : {kSurfels, kOccupied, kFrontier, kMarkers})
    if (is_stale(topic)) return next_time_;
  return asks_again_ ? std::make_optional(next_time_.load()) : std::nullopt;
}

bool MapPublisher::is_stale(Topic topic) const {
  return map_.sequence() != 0 && sent_[topic] != (topic == kMarkers ? pushes_ : version_) && is_heard(topic);
}

/// Applies everything that was pushed, and publishes an update for each push. If there is a new subscriber or a whole map, it publishes one
/// update with the whole map instead, which serves the older subscribers as well.
void MapPublisher::apply_and_tell(const std::deque<PushedChanges>& queue) {
  const bool whole = at_once_[kUpdate] || (!queue.empty() && queue.front().since == 0);
  Eigen::AlignedBox3f touched;
  for (const PushedChanges& pushed : queue) {
    if (stopping_) return;
    Eigen::AlignedBox3f box;
    if (!apply(pushed, box)) return;
    touched.extend(box);
    if (!whole) publish_update({pushed.changes, pushed.since, box, confident_, most_surfels_});
  }
  if (!whole || map_.sequence() == 0) return;
  at_once_[kUpdate] = false;
  if (!is_heard(kUpdate)) return;
  for (const Surfel& surfel : map_.slots()) touched.extend(surfel.position);
  publish_update({map_, touched, confident_, most_surfels_});
}

/// Publishes all parts. A part that cannot be made is left out, and subscribers notice this.
void MapPublisher::publish_update(messages::UpdateMessages update) {
  while (!update.done() && is_heard(kUpdate) && !stopping_) publish(kUpdate, [&] { return with_header(update.next()); });
}

/// @return false if it failed; the next push will then be the whole map
bool MapPublisher::apply(const PushedChanges& pushed, Eigen::AlignedBox3f& box) {
  const bool is_first = map_.sequence() == 0;
  try {
    box = map_.apply(pushed.changes, pushed.since, [this](const Surfel& surfel, bool comes) { markers_.touch(surfel, comes); });
  } catch (const std::exception& fault) {
    warn("The copy of the map that is published is built again, because changes could not be applied: ", fault);
    start_over();
    return false;
  }
  state_ = pushed.state;
  ++pushes_;
  if (is_first || !box.isEmpty()) ++version_;
  return true;
}

/// Each kind of warning every few seconds at most.
void MapPublisher::warn(const std::string& what, const std::exception& fault) {
  const std::string warning = what + fault.what();
  if (warnings_.due(warning, Clock::now()) > 0) ROS_WARN("%s", warning.c_str());
}

void MapPublisher::start_over() {
  map_ = SurfelMirror();
  markers_.forget();
  const std::lock_guard<std::mutex> lock(mutex_);
  queue_.clear();
  pushed_ = 0;
}

void MapPublisher::publish_what_is_due() {
  if (!is_heard(kMarkers)) markers_.forget();
  if (map_.sequence() == 0) return;
  const bool due = Clock::now() >= next_time_.load();
  const double cpu_before = cpu_time();
  bool published = false;
  for (const Topic topic : {kSurfels, kOccupied, kFrontier, kMarkers}) {
    if (stopping_) return;
    const bool anew = at_once_[topic] && (topic == kMarkers || is_stale(topic));  // roscpp latches the clouds, but not the markers
    if (anew || (due && is_stale(topic))) {
      topic == kMarkers ? publish_markers() : publish_cloud(topic);
      published = true;
    }
    at_once_[topic] = false;
  }
  // The pause begins after publishing, so that a slow machine has time for other things, and it is longer for larger maps. Publishing for
  // new subscribers alone does not delay the others.
  const std::chrono::duration<double> rest((cpu_time() - cpu_before) / kShare);
  if (due && published) next_time_ = Clock::now() + std::max(period_, std::chrono::duration_cast<Clock::duration>(rest));
}

/// Publishes the message that `make` returns. A message that cannot be made is left out, with a warning.
template <typename Make>
void MapPublisher::publish(Topic topic, Make make) {
  if (!is_heard(topic)) return;
  try {
    if (listeners_within_[topic] > 0)
      publishers_[topic].publish(boost::make_shared<decltype(make())>(make()));
    else
      publishers_[topic].publish(serialized(make()));
  } catch (const std::exception& fault) {
    warn("A message on " + publishers_[topic].getTopic() + " was left out: ", fault);
    if (topic == kMarkers) markers_.forget();
  }
}

void MapPublisher::publish_cloud(Topic topic) {
  sent_[topic] = version_;
  publish(topic, [&] {
    const std::optional<Label> label = topic == kOccupied   ? std::make_optional(Label::kOccupied)
                                       : topic == kFrontier ? std::make_optional(Label::kFrontier)
                                                            : std::nullopt;
    return with_header(messages::to_cloud(map_, confident_, label, most_surfels_));
  });
}

void MapPublisher::publish_markers() {
  sent_[kMarkers] = pushes_;
  publish(kMarkers, [&] { return markers_.update(map_, state_.camera, state_.stamp, at_once_[kMarkers]); });
}

std_msgs::Header MapPublisher::header() const {
  std_msgs::Header header;
  header.stamp = state_.stamp;
  header.frame_id = world_frame_;
  return header;
}

sensor_msgs::PointCloud2 MapPublisher::with_header(sensor_msgs::PointCloud2 cloud) const {
  cloud.header = header();
  return cloud;
}

SurfelUpdate MapPublisher::with_header(SurfelUpdate update) const {
  update.header = update.surfels.header = header();
  return update;
}

}  // namespace frontier_surfels
