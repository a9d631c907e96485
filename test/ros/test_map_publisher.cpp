/// The mapping thread, the publisher's thread and subscribers at once, with a map that changes at random instead of a mapper. Run it under
/// ThreadSanitizer as well: scripts/test --threads.
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <visualization_msgs/MarkerArray.h>

#include <atomic>
#include <map>
#include <thread>

#include "ros/client/map_subscriber.hpp"
#include "ros/master_input.hpp"
#include "ros/output/map_publisher.hpp"
#include "ros/surfel_input.hpp"
#include "ros/worker.hpp"
#include "same_surfels.hpp"

namespace frontier_surfels {
namespace {

constexpr int kFrames = 150;
constexpr std::uint32_t kIds = 3000;

/// Stands for the mapper: only the worker touches it.
class RandomMap {
 public:
  void change() {
    const Changes frame = random_changes(rng_, map_.sequence(), kIds, 200);
    map_.apply(frame, map_.sequence());
    for (const Surfel& surfel : frame.updated) changed_[surfel.id] = map_.sequence();
    for (const std::uint32_t id : frame.removed) changed_[id] = map_.sequence();
  }

  Changes changes(std::uint64_t since) const {
    Changes changes;
    changes.sequence = map_.sequence();
    for (const auto& [id, sequence] : changed_) {
      if (sequence <= since) continue;
      if (const Surfel* surfel = map_.slots().find(id)) {
        changes.updated.push_back(*surfel);
      } else {
        changes.removed.push_back(id);
      }
    }
    return changes;
  }

  std::uint64_t sequence() const { return map_.sequence(); }
  std::vector<Surfel> surfels() const { return map_.surfels(); }

 private:
  Rng rng_{3};
  SurfelMirror map_;
  std::map<std::uint32_t, std::uint64_t> changed_;
};

NodeConfig config() {
  NodeConfig config;
  config.publish_period = 0.05;
  config.message_limit = 1000;  // updates of the whole map come in parts
  return config;
}

/// The threads of a mapper node. MapperRos connects them in the same way.
class Node {
 public:
  Node() : worker_([this] { return map_next(); }, [this] { publish_changes(); }), publisher_(pnh_, config(), [this] { worker_.wake(); }) {
    worker_.start();
  }
  ~Node() { worker_.stop(); }

  void map_frames(int count) {
    frames_ += count;
    worker_.wake();
  }
  bool is_done() const { return frames_ == 0; }
  Changes all() {
    return worker_.run_job([this] { return map_.changes(0); });
  }

 private:
  bool map_next() {
    if (frames_ == 0) return false;
    map_.change();
    --frames_;
    return frames_ > 0;
  }

  void publish_changes() {
    if (!publisher_.wants_changes()) return;
    const std::uint64_t since = publisher_.sequence();
    if (since != map_.sequence()) publisher_.push(map_.changes(since), since, {});
  }

  ros::NodeHandle pnh_{"~"};
  RandomMap map_;
  std::atomic<int> frames_{0};
  Worker worker_;
  MapPublisher publisher_;
};

/// Subscribes and unsubscribes clouds and markers until it is told to stop, and counts what comes.
class Visitors {
 public:
  Visitors() : thread_([this] { run(); }) {}
  ~Visitors() {
    stop_ = true;
    thread_.join();
  }

  std::atomic<int> clouds{0}, markers{0};

 private:
  void run() {
    ros::CallbackQueue queue;
    ros::NodeHandle nh("~");
    nh.setCallbackQueue(&queue);
    while (!stop_) {
      const auto count_cloud = [this](const sensor_msgs::PointCloud2ConstPtr&) { ++clouds; };
      const auto count_marker = [this](const visualization_msgs::MarkerArrayConstPtr&) { ++markers; };
      const auto surfels = nh.subscribe<sensor_msgs::PointCloud2>("surfels", 1, count_cloud);
      const auto occupied = nh.subscribe<sensor_msgs::PointCloud2>("occupied", 1, count_cloud);
      const auto shown = nh.subscribe<visualization_msgs::MarkerArray>("markers", 1, count_marker);
      const auto end = ros::WallTime::now() + ros::WallDuration(0.1);
      while (ros::WallTime::now() < end) queue.callAvailable(ros::WallDuration(0.02));
    }
  }

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

TEST(MapPublisher, WhoFollowsHasTheMapWhateverOthersDo) {
  ros::CallbackQueue queue;
  ros::NodeHandle nh("~");
  nh.setCallbackQueue(&queue);
  Node node;
  Visitors visitors;
  UpdateReceiver follower([&] { return node.all(); });
  const auto updates = nh.subscribe<SurfelUpdate>("update", 0, [&](const SurfelUpdateConstPtr& update) { follower.receive(*update); });

  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(60);
  const auto handle_until = [&](const auto& done) {
    while (!done() && ros::WallTime::now() < deadline) queue.callAvailable(ros::WallDuration(0.02));
    return done();
  };
  for (int frame = 0; frame < kFrames; ++frame) {
    node.map_frames(1);
    queue.callAvailable(ros::WallDuration(0.005));
    if (frame % 10 == 0) node.all();  // as services do, in between
  }
  ASSERT_TRUE(handle_until([&] { return node.is_done(); }));
  const Changes all = node.all();
  ASSERT_TRUE(handle_until([&] { return follower.map().sequence() == all.sequence; }));
  EXPECT_TRUE(same(follower.map().surfels(), all.updated));
  EXPECT_GT(all.updated.size(), 1000U);
  EXPECT_TRUE(handle_until([&] { return visitors.markers > 2; }));
}

}  // namespace
}  // namespace frontier_surfels

int main(int argc, char** argv) { return frontier_surfels::run_tests_with_master(argc, argv, "test_map_publisher"); }
