/// A copy of a running mapper's map, for programs that subscribe ~update.
#pragma once

#include <frontier_surfels/SurfelUpdate.h>
#include <ros/node_handle.h>
#include <ros/service_client.h>
#include <ros/subscriber.h>

#include <functional>
#include <string>

#include "ros/input/warning_throttle.hpp"
#include "ros/output/surfel_mirror.hpp"

namespace frontier_surfels {

/// Applies updates to a copy of the map. If updates are missing, it asks for the whole map. It contains no ROS communication.
class UpdateReceiver {
 public:
  /// Gets the whole map with its number, as ~get_surfels answers it. If it throws, the next update tries again.
  using GetAll = std::function<Changes()>;

  explicit UpdateReceiver(GetAll get_all);

  /// Follows the rules of msg/SurfelUpdate.msg.
  /// @throws Error if the message is damaged, and whatever GetAll throws; the map is then as before
  void receive(const SurfelUpdate& update);

  /// Replaces the copy by the whole map. @throws whatever GetAll throws
  void take_all();

  const SurfelMirror& map() const { return map_; }
  std::size_t gaps() const { return gaps_; }  ///< how often updates were missing; joining late does not count

 private:
  bool collect(const SurfelUpdate& update);

  GetAll get_all_;
  SurfelMirror map_;
  Changes collected_;            ///< of the parts of an update that have come so far
  std::uint64_t since_ = 0;      ///< of these parts
  std::uint32_t next_part_ = 0;  ///< number that the next part must have; 0: the first part of any update
  std::size_t gaps_ = 0;
};

/// An UpdateReceiver with the topics and services of the mapper node `mapper`. Callbacks in the queue of `nh` change the map, so that only
/// the thread that handles this queue may read it.
class MapSubscriber {
 public:
  MapSubscriber(ros::NodeHandle& nh, const std::string& mapper);
  MapSubscriber(const MapSubscriber&) = delete;
  MapSubscriber& operator=(const MapSubscriber&) = delete;

  const SurfelMirror& map() const { return receiver_.map(); }
  std::size_t gaps() const { return receiver_.gaps(); }
  bool connected() const { return updates_.getNumPublishers() > 0; }

  /// Asks for the whole map, for the case that updates do not come. @throws Error if the mapper does not answer
  void take_all() { receiver_.take_all(); }

 private:
  Changes ask_for_all();
  void on_update(const SurfelUpdateConstPtr& update);

  ros::ServiceClient get_surfels_;
  UpdateReceiver receiver_;
  WarningThrottle warnings_{std::chrono::seconds(5)};
  ros::Subscriber updates_;
};

}  // namespace frontier_surfels
