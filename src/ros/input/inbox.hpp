/// Where depth images wait: first for what belongs to them, then for the mapper.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "ros/input/camera_frame.hpp"

namespace frontier_surfels {

/// A depth image that will not be mapped, and why.
struct DroppedImage {
  DepthArrival arrival;
  std::uint8_t result;  ///< one of FrameReport's
  std::string reason;   ///< a sentence
};

/// The waiting depth images of one camera. No ROS communication, no clock and no locks in it.
///
/// An image becomes ready as soon as it is complete. Ready images leave in the order of their stamps. Images that become ready at about the
/// same time, as when one transform completes several, are all kept for the mapper. If an image has waited for the mapper longer than that
/// when the next one becomes ready, the mapper is too slow for the camera, and only the newest image is kept.
class Inbox {
 public:
  /// Collects what belongs to an image. @return empty if something is missing and may still arrive
  /// @param last_chance  the image will not be asked for again: what is missing must be told
  /// @throws DroppedFrame with the reason why the image cannot be mapped
  using Complete = std::function<std::optional<CompleteImage>(const DepthArrival& arrival, bool last_chance)>;

  /// @param timeout  how long an image waits to be complete
  explicit Inbox(std::chrono::duration<double> timeout);

  void add(const DepthArrival& arrival);

  /// Looks for images that are complete, and for those that have waited too long. @return images that are dropped
  std::vector<DroppedImage> look_through(const Complete& complete, Clock::time_point now);

  /// Drops everything that waits, for this reason.
  std::vector<DroppedImage> clear(std::uint8_t result, const std::string& reason);

  /// The next image may have any stamp.
  void forget_stamps() { last_stamp_ = ros::Time(); }

  bool is_waiting() const { return !waiting_.empty(); }  ///< an image is not complete
  bool is_ready() const { return !ready_.empty(); }

  /// Stamp of the next ready image. There must be one.
  ros::Time next_stamp() const { return ready_.front().image.arrival.image.header().stamp; }

  /// Takes the next ready image. There must be one.
  CompleteImage take();

  /// Stamp of the last image that has become ready; 0 if there is none. Images with earlier stamps come too late.
  const ros::Time& last_stamp() const { return last_stamp_; }

  /// Number of images that have become ready so far.
  std::uint64_t completed() const { return completed_; }

 private:
  struct ReadyImage {
    CompleteImage image;
    Clock::time_point since;
  };

  std::vector<CompleteImage> complete_ones(const Complete& complete, Clock::time_point now, std::vector<DroppedImage>& dropped);
  void drop_ready(std::uint8_t result, const std::string& reason, std::vector<DroppedImage>& dropped);

  const std::chrono::duration<double> timeout_;
  const std::size_t most_waiting_;
  std::deque<DepthArrival> waiting_;  ///< ordered by stamp
  std::deque<ReadyImage> ready_;      ///< ordered by stamp
  ros::Time last_stamp_;
  std::uint64_t completed_ = 0;
};

}  // namespace frontier_surfels
