/// A copy of the map that is kept up to date by the map's changes.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <vector>

#include "frontier_surfels/types.hpp"
#include "ros/output/surfel_slots.hpp"

namespace frontier_surfels {

/// Size of a surfel in a PointCloud2 [byte].
constexpr std::size_t kBytesOfSurfel = 48;

/// Maximum number of surfels in a PointCloud2.
constexpr std::size_t kMostSurfels = 0xffffffffu / kBytesOfSurfel;

/// Contains no ROS and no locks.
class SurfelMirror {
 public:
  /// Called for every surfel that goes (comes = false) and that comes (comes = true). A surfel that changes goes and comes.
  using Visit = std::function<void(const Surfel& surfel, bool comes)>;

  /// Sequence number of the map that this is a copy of; 0 before the first changes.
  std::uint64_t sequence() const { return sequence_; }
  std::size_t size() const { return size_; }
  std::size_t occupied() const { return occupied_; }

  /// Applies the changes since the number `since`, which must be sequence(), or 0 if the changes contain the whole map.
  /// @return the box around the centres of all surfels that go or come; empty if there are none
  /// @throws Error if `since` is another number; the copy is then as before
  Eigen::AlignedBox3f apply(const Changes& changes, std::uint64_t since, const Visit& visit = {});

  /// All surfels, ordered by id.
  std::vector<Surfel> surfels() const;
  /// The surfels of one label, ordered by id.
  std::vector<Surfel> surfels(Label label) const;
  /// The surfels whose centre lies in the box, ordered by id.
  std::vector<Surfel> surfels(const Eigen::AlignedBox3f& box_world) const;

  /// All surfels, by id.
  const SurfelSlots& slots() const { return slots_; }

 private:
  std::uint64_t sequence_ = 0;
  std::size_t size_ = 0, occupied_ = 0;
  SurfelSlots slots_;
};

/// Two changes that follow each other as one. If both name a surfel, the later ones count. An id that was removed and then given to another
/// surfel is both removed and updated. Surfels and ids are ordered.
Changes merge(Changes earlier, Changes later);

}  // namespace frontier_surfels
