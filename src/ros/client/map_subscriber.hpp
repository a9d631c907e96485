/// The other end of ~update: a copy of a running mapper's map.
#pragma once

#include <frontier_surfels/SurfelUpdate.h>
#include <ros/node_handle.h>
#include <ros/service_client.h>
#include <ros/subscriber.h>

#include <functional>
#include <string>

#include "ros/output/surfel_mirror.hpp"

namespace frontier_surfels {

/// Applies updates to a copy of the map; asks for the whole map where some are missing. No ROS communication in it.
class UpdateReceiver {
 public:
  /// The whole map, with its number: what ~get_surfels answers. May throw; the next update tries again.
  using GetAll = std::function<Changes()>;

  explicit UpdateReceiver(GetAll get_all);

  /// The rules are those of msg/SurfelUpdate.msg. @throws Error if the message cannot be understood, and whatever GetAll throws; the map
  /// stays as it was then
  void receive(const SurfelUpdate& update);

  /// Takes the whole map instead of what is here. @throws whatever GetAll throws
  void take_all();

  const SurfelMirror& map() const { return map_; }
  std::size_t gaps() const { return gaps_; }  ///< between updates that were noticed and healed; joining late is none

 private:
  GetAll get_all_;
  SurfelMirror map_;
  std::size_t gaps_ = 0;
};

/// An UpdateReceiver on the topics and services of the mapper node `mapper`. The callback queue of `nh` changes the map: whoever handles
/// that queue may read it.
class MapSubscriber {
 public:
  MapSubscriber(ros::NodeHandle& nh, const std::string& mapper);
  MapSubscriber(const MapSubscriber&) = delete;
  MapSubscriber& operator=(const MapSubscriber&) = delete;

  const SurfelMirror& map() const { return receiver_.map(); }
  std::size_t gaps() const { return receiver_.gaps(); }
  bool connected() const { return updates_.getNumPublishers() > 0; }

  /// Asks for the whole map, for when updates fail to come. @throws Error
  void take_all() { receiver_.take_all(); }

 private:
  Changes ask_for_all();
  void on_update(const SurfelUpdateConstPtr& update);

  ros::ServiceClient get_surfels_;
  UpdateReceiver receiver_;
  ros::Subscriber updates_;
};

}  // namespace frontier_surfels
