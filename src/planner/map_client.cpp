#include "frontier_surfels/planner/map_client.hpp"

#include <utility>

namespace frontier_surfels {

bool MapClient::apply(const StateChanges& changes) {
  if (changes.since != 0 || changes.resolution == grid_.resolution()) return grid_.apply(changes);
  StateGrid begun(changes.resolution);
  begun.apply(changes);
  grid_ = std::move(begun);
  return true;
}

bool MapClient::apply(const Changes& changes) {
  if (changes.since != 0 && changes.sequence <= surfel_sequence_) return true;
  if (changes.since > surfel_sequence_) return false;
  if (changes.since == 0) surfels_.clear();
  for (const std::uint32_t id : changes.removed) surfels_.erase(id);
  for (const Surfel& surfel : changes.updated) surfels_[surfel.id] = surfel;
  surfel_sequence_ = changes.sequence;
  return true;
}

std::vector<Surfel> MapClient::surfels(const Eigen::AlignedBox3f& box_world) const {
  std::vector<Surfel> inside;
  for (const auto& [id, surfel] : surfels_)
    if (box_world.contains(surfel.position)) inside.push_back(surfel);
  return inside;
}

}  // namespace frontier_surfels
