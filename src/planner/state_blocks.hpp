/// The grid of states as the mapper knows it, for Mapper::state_changes().
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "frontier_surfels/planner/state_grid.hpp"
#include "map/block_key.hpp"
#include "opencl/commands.hpp"
#include "planner/point_states.hpp"
#include "planner/state_cells.hpp"

namespace frontier_surfels {

/// Blocks of the map of which frames may have changed something, each with the number of the last such frame.
class ChangedBlocks {
 public:
  void note(const std::vector<BlockKey>& blocks, std::uint64_t sequence) {
    for (const BlockKey& block : blocks) last_[block] = sequence;
  }

  /// The map has been replaced: what was before cannot be told from now on.
  void begin(std::uint64_t sequence) {
    last_.clear();
    begin_ = sequence;
  }

  bool knows(std::uint64_t since) const { return since != 0 && since >= begin_; }
  std::vector<BlockKey> since(std::uint64_t sequence) const;  ///< sorted

 private:
  std::unordered_map<BlockKey, std::uint64_t> last_;
  std::uint64_t begin_ = 0;
};

/// Keeps the cells of all blocks that were ever asked for, so that little is left to find when they are asked for again: a cell that was
/// free stays so until its centre is taken back or a surfel passes; one that was not becomes free if a view since then has seen its centre.
class StateBlocks {
 public:
  /// Blocks of the map that have changed since sequence().
  struct Changed {
    std::vector<BlockKey> looked_at;  ///< by frames
    std::vector<BlockKey> taken;      ///< points have been taken back, or given back
    std::vector<BlockKey> surfels;
  };

  explicit StateBlocks(Commands& commands) : cells_(commands) {}

  /// Number of the map that the kept cells are true of; 0 if there are none.
  std::uint64_t sequence() const { return sequence_; }

  /// Forgets all cells. @param resolution  edge of a cell from now on [m]
  void begin(double resolution);
  double resolution() const { return resolution_; }

  /// Brings all cells up to date, and those of the blocks that meet some blocks of the map come to be known. After begin(), these must be
  /// all of which anything is known: later, only views that have come since are asked.
  void update(const std::vector<BlockKey>& map_blocks, const Changed& changed, std::uint64_t sequence, const KnownWorld& world);

  /// Of the grid's blocks that meet some blocks of the map those that may have changed after `since`, sorted. They must be known.
  std::vector<StateBlock> changes(const std::vector<BlockKey>& map_blocks, std::uint64_t since, const SurfelMap& map) const;

 private:
  struct Block {
    CellBits free = {};             ///< cells whose centre is free
    std::vector<CellRows> surfels;  ///< cells through which frontier surfels pass, and occupied ones; empty if none does
    std::uint64_t changed = 0;      ///< sequence number when it was last found to be different
    StateBlock packed(const BlockKey& key) const;
  };

  double edge() const { return StateBlock::kEdge * resolution_; }  ///< of a block [m]
  std::vector<BlockKey> meeting(const std::vector<BlockKey>& map_blocks, double margin, double block_size) const;
  void find_free(const std::vector<BlockKey>& fresh, const Changed& changed, std::uint64_t sequence, const KnownWorld& world);
  void find_surfels(const std::vector<BlockKey>& fresh, const std::vector<BlockKey>& changed, std::uint64_t sequence, const SurfelMap& map);

  StateCells cells_;
  double resolution_ = 0;
  std::uint64_t sequence_ = 0, last_view_ = 0;  ///< RecentViews::current_number() then
  std::unordered_map<BlockKey, Block> blocks_;
};

}  // namespace frontier_surfels
