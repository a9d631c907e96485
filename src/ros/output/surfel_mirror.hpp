/// The map on the host, kept up to date by changes: what is published is taken from here, never from the device.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <vector>

#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Size of a surfel in a PointCloud2 [byte].
constexpr std::size_t kBytesOfSurfel = 48;

/// Maximum number of surfels in a PointCloud2. An id that is not below it must be damaged.
constexpr std::size_t kMostSurfels = 0xffffffffu / kBytesOfSurfel;

/// Whether there is a surfel in a slot of SurfelMirror.
inline bool exists(const Surfel& slot) { return slot.radius != 0; }

/// No ROS, no locks.
class SurfelMirror {
 public:
  /// Is told of every surfel that goes (false) and that comes (true); of one that changes, as it was and as it is.
  using Visit = std::function<void(const Surfel& surfel, bool comes)>;

  /// Number of the map that this is; 0: empty, before any.
  std::uint64_t sequence() const { return sequence_; }
  std::size_t size() const { return size_; }
  std::size_t occupied() const { return occupied_; }

  /// Applies what has changed since `since`, which must be sequence(), or 0: the whole map.
  /// @return the box around the centres of all surfels added, changed (before and after) or removed; empty if there are none
  /// @throws Error if `since` is another number or an id is impossible: nothing has changed
  Eigen::AlignedBox3f apply(const Changes& changes, std::uint64_t since, const Visit& visit = {});

  /// All surfels, ordered by id.
  std::vector<Surfel> surfels() const;
  /// Those of one label.
  std::vector<Surfel> surfels(Label label) const;
  /// Those whose centre lies in the box.
  std::vector<Surfel> surfels(const Eigen::AlignedBox3f& box_world) const;

  /// By id, from 0 to the highest one; radius 0: there is no surfel of this id.
  const std::vector<Surfel>& slots() const { return slots_; }

 private:
  std::uint64_t sequence_ = 0;
  std::size_t size_ = 0, occupied_ = 0;
  std::vector<Surfel> slots_;
};

/// One difference instead of two that follow each other: where both name a surfel, the later one holds. Both ordered by id afterwards.
Changes merge(Changes earlier, Changes later);

}  // namespace frontier_surfels
