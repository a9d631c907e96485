#include "ros/input/inbox.hpp"

#include <frontier_surfels/FrameReport.h>

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

constexpr double kFastestCamera = 100;                     // [Hz]
constexpr auto kTogether = std::chrono::milliseconds(20);  // less than the period of usual cameras

const ros::Time& stamp_of(const DepthArrival& arrival) { return arrival.image.header().stamp; }

}  // namespace

Inbox::Inbox(std::chrono::duration<double> timeout)
    : timeout_(timeout), most_waiting_(2 + static_cast<std::size_t>(std::ceil(kFastestCamera * timeout.count()))) {}

void Inbox::add(const DepthArrival& arrival) {
  const auto later = std::upper_bound(waiting_.begin(), waiting_.end(), arrival,
                                      [](const DepthArrival& a, const DepthArrival& b) { return stamp_of(a) < stamp_of(b); });
  waiting_.insert(later, arrival);
}

/// Takes the complete images out of waiting_, ordered by stamp.
std::vector<CompleteImage> Inbox::complete_ones(const Complete& complete, Clock::time_point now, std::vector<DroppedImage>& dropped) {
  const std::size_t too_many = waiting_.size() > most_waiting_ ? waiting_.size() - most_waiting_ : 0;
  std::vector<CompleteImage> found;
  // From the newest to the oldest: whatever arrives meanwhile cannot complete an image and miss an older one.
  for (std::size_t i = waiting_.size(); i-- > 0;) {
    const DepthArrival& arrival = waiting_[i];
    const bool last_chance = now - arrival.time >= timeout_ || i < too_many;
    try {
      std::optional<CompleteImage> image = complete(arrival, last_chance);
      if (!image) continue;
      found.push_back(std::move(*image));
    } catch (const DroppedFrame& fault) {
      dropped.push_back({arrival, fault.result, fault.what()});
    }
    waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(i));
  }
  std::reverse(found.begin(), found.end());
  return found;
}

std::vector<DroppedImage> Inbox::look_through(const Complete& complete, Clock::time_point now) {
  std::vector<DroppedImage> dropped;
  const bool is_mapper_slow = !ready_.empty() && now - ready_.front().since > kTogether;
  for (CompleteImage& image : complete_ones(complete, now, dropped)) {
    const ros::Time stamp = stamp_of(image.arrival);
    if (stamp < last_stamp_) {
      dropped.push_back({image.arrival, FrameReport::DROPPED_OUT_OF_ORDER,
                         "A later depth image was complete before this one: images must be mapped in the order of their stamps."});
      continue;
    }
    last_stamp_ = stamp;
    ++completed_;
    if (is_mapper_slow) drop_ready(FrameReport::DROPPED_QUEUE, "A newer depth image came before this one's turn.", dropped);
    ready_.push_back({std::move(image), now});
  }
  return dropped;
}

void Inbox::drop_ready(std::uint8_t result, const std::string& reason, std::vector<DroppedImage>& dropped) {
  for (const ReadyImage& ready : ready_) dropped.push_back({ready.image.arrival, result, reason});
  ready_.clear();
}

std::vector<DroppedImage> Inbox::clear(std::uint8_t result, const std::string& reason) {
  std::vector<DroppedImage> dropped;
  drop_ready(result, reason, dropped);
  for (const DepthArrival& arrival : waiting_) dropped.push_back({arrival, result, reason});
  waiting_.clear();
  return dropped;
}

CompleteImage Inbox::take() {
  CompleteImage image = std::move(ready_.front().image);
  ready_.pop_front();
  return image;
}

}  // namespace frontier_surfels
