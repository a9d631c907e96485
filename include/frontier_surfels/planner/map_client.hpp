/// The map in a planner's own process, with ROS or without: it follows ~update and ~states_update, and answers in tens of nanoseconds.
///
///     frontier_surfels::MapClient map;
///     void on_states(const frontier_surfels::StatesUpdate& message) {
///       if (!map.apply(frontier_surfels::to_state_changes(message))) { GetStateGrid all; if (get_state_grid.call(all)) map.apply(...) }
///     }
///     map.grid().state(p), .ray_state(...), .box_state(...), .path_state(...), .clearance(p, most)
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "frontier_surfels/planner/state_grid.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// A late joiner begins with whatever comes: as long as apply() returns false, changes are missing, and the caller asks for the whole
/// (~get_state_grid, ~get_surfels) and applies that. Calls that do not change the client may come from several threads at once, if none
/// applies changes meanwhile.
class MapClient {
 public:
  /// @return false  changes are missing, and nothing was done. @throws Error  they are damaged, and nothing was done
  bool apply(const StateChanges& changes);
  bool apply(const Changes& changes);

  /// States of the world; before the first changes, all of it is unknown.
  const StateGrid& grid() const { return grid_; }

  /// The surfels by id.
  const std::map<std::uint32_t, Surfel>& surfels() const { return surfels_; }
  std::vector<Surfel> surfels(const Eigen::AlignedBox3f& box_world) const;
  std::uint64_t surfel_sequence() const { return surfel_sequence_; }

 private:
  StateGrid grid_ = StateGrid(0.05);
  std::map<std::uint32_t, Surfel> surfels_;
  std::uint64_t surfel_sequence_ = 0;
};

/// A frontier_surfels/StatesUpdate as changes. A template, so that this header needs no ROS. @throws Error  the message is damaged
template <typename StatesUpdate>
StateChanges to_state_changes(const StatesUpdate& message) {
  StateChanges changes = {message.sequence, message.since, message.resolution, {}};
  std::size_t begin = 0;
  if (message.blocks.size() != 3 * message.kinds.size())
    throw Error("An update of states has " + std::to_string(message.blocks.size()) + " coordinates for " +
                std::to_string(message.kinds.size()) + " blocks: the message is damaged.");
  for (std::size_t n = 0; n < message.kinds.size(); ++n) {
    StateBlock block = {{message.blocks[3 * n], message.blocks[3 * n + 1], message.blocks[3 * n + 2]}, {message.kinds[n]}};
    if (message.kinds[n] == StatesUpdate::MIXED) {
      if (message.cells.size() - begin < StateBlock::kBytes) throw Error("An update of states is cut short: the message is damaged.");
      const auto first = message.cells.begin() + static_cast<std::ptrdiff_t>(begin);
      block.cells.assign(first, first + StateBlock::kBytes);
      begin += StateBlock::kBytes;
    }
    changes.blocks.push_back(std::move(block));
  }
  if (begin != message.cells.size()) throw Error("An update of states is too long: the message is damaged.");
  return changes;
}

}  // namespace frontier_surfels
