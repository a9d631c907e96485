#include "ros/client/map_subscriber.hpp"

#include <frontier_surfels/GetSurfels.h>
#include <ros/console.h>

#include <limits>
#include <utility>

#include "ros/output/surfel_messages.hpp"

namespace frontier_surfels {

UpdateReceiver::UpdateReceiver(GetAll get_all) : get_all_(std::move(get_all)) {}

void UpdateReceiver::receive(const SurfelUpdate& update) {
  const bool whole = update.since == 0;
  if (!whole && update.sequence <= map_.sequence()) return;
  if (!collect(update)) return;
  const Changes changes = std::exchange(collected_, {});
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

/// Puts the parts of an update together. If a part is missing, the others are left out, as if the whole update had been lost.
/// @return whether the update is complete
bool UpdateReceiver::collect(const SurfelUpdate& update) {
  const bool continues = update.part == next_part_ && update.sequence == collected_.sequence && update.since == since_;
  if (update.part != 0 && !continues) {
    next_part_ = 0;
    return false;
  }
  next_part_ = 0;  // for the case that the message is damaged
  const std::vector<Surfel> surfels = messages::to_surfels(update.surfels);
  if (update.part == 0) collected_ = {};
  collected_.sequence = update.sequence;
  since_ = update.since;
  collected_.updated.insert(collected_.updated.end(), surfels.begin(), surfels.end());
  collected_.removed.insert(collected_.removed.end(), update.removed.begin(), update.removed.end());
  if (update.part + 1 >= update.parts) return true;
  next_part_ = update.part + 1;
  return false;
}

void UpdateReceiver::take_all() { map_.apply(get_all_(), 0); }

MapSubscriber::MapSubscriber(ros::NodeHandle& nh, const std::string& mapper)
    : get_surfels_(nh.serviceClient<GetSurfels>(mapper + "/get_surfels")),
      receiver_([this] { return ask_for_all(); }),
      updates_(nh.subscribe(mapper + "/update", 0, &MapSubscriber::on_update, this)) {}  // a queue of any length: no update is dropped here

Changes MapSubscriber::ask_for_all() {
  GetSurfels service;  // both corners are equal, which asks for all surfels
  service.request.most = std::numeric_limits<std::uint32_t>::max();
  Changes all;
  do {
    if (!get_surfels_.call(service))
      throw Error("The service " + get_surfels_.getService() + " did not answer: is the mapper still running?");
    const std::vector<Surfel> part = messages::to_surfels(service.response.surfels);
    // Later parts may be of a later map. The updates since the first part's number then repeat some of their changes.
    if (all.sequence == 0) all.sequence = service.response.sequence;
    all.updated.insert(all.updated.end(), part.begin(), part.end());
    service.request.first_id = service.response.next_id;
  } while (service.response.next_id != 0);
  return all;
}

void MapSubscriber::on_update(const SurfelUpdateConstPtr& update) {
  try {
    receiver_.receive(*update);
  } catch (const std::exception& fault) {
    if (warnings_.due(fault.what(), WarningThrottle::Clock::now()) > 0)
      ROS_WARN("An update of the map could not be applied: %s", fault.what());
  }
}

}  // namespace frontier_surfels
