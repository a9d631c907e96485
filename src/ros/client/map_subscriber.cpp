#include "ros/client/map_subscriber.hpp"

#include <frontier_surfels/GetSurfels.h>
#include <ros/console.h>

#include <utility>

#include "ros/output/surfel_messages.hpp"

namespace frontier_surfels {

UpdateReceiver::UpdateReceiver(GetAll get_all) : get_all_(std::move(get_all)) {}

void UpdateReceiver::receive(const SurfelUpdate& update) {
  const bool whole = update.since == 0;
  if (!whole && update.sequence <= map_.sequence()) return;
  const Changes changes{update.sequence, messages::to_surfels(update.surfels), update.removed};
  if (whole) {
    map_.apply(changes, 0);
    return;
  }
  if (update.since > map_.sequence()) {
    const bool joining = map_.sequence() == 0;
    take_all();
    if (!joining) ++gaps_;
    if (update.sequence <= map_.sequence() || update.since > map_.sequence()) return;
  }
  // An update that begins before this map contains more than is missing, which does no harm.
  map_.apply(changes, map_.sequence());
}

void UpdateReceiver::take_all() { map_.apply(get_all_(), 0); }

MapSubscriber::MapSubscriber(ros::NodeHandle& nh, const std::string& mapper)
    : get_surfels_(nh.serviceClient<GetSurfels>(mapper + "/get_surfels")),
      receiver_([this] { return ask_for_all(); }),
      updates_(nh.subscribe(mapper + "/update", 0, &MapSubscriber::on_update, this)) {}  // a queue of any length: no update is dropped here

Changes MapSubscriber::ask_for_all() {
  GetSurfels service;  // both corners are equal, which asks for all surfels
  if (!get_surfels_.call(service))
    throw Error("The service " + get_surfels_.getService() + " did not answer: is the mapper still running?");
  return {service.response.sequence, messages::to_surfels(service.response.surfels), {}};
}

void MapSubscriber::on_update(const SurfelUpdateConstPtr& update) {
  try {
    receiver_.receive(*update);
  } catch (const std::exception& fault) {
    ROS_WARN_THROTTLE(5, "An update of the map could not be applied: %s", fault.what());
  }
}

}  // namespace frontier_surfels
