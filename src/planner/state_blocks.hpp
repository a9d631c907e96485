/// The grid of states, for Mapper::state_changes(): kernels/planner/state_cells.cl.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "common/shared.h"
#include "frontier_surfels/planner/state_grid.hpp"
#include "map/block_key.hpp"
#include "opencl/commands.hpp"
#include "planner/point_states.hpp"

namespace frontier_surfels {

/// The blocks of the map of which frames may have changed something, each with the number of the last such frame.
class LookedAt {
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

class StateBlocks {
 public:
  explicit StateBlocks(Commands& commands);

  /// The grid's blocks that meet some blocks of the map, sorted; with all their cells. @param resolution  edge of a cell [m]
  std::vector<StateBlock> find(const std::vector<BlockKey>& map_blocks, double resolution, PointStates& states, const KnownWorld& world);

 private:
  using Block = std::array<std::int32_t, 3>;
  void find_some(const std::vector<Block>& blocks, double resolution, PointStates& states, const KnownWorld& world,
                 std::vector<StateBlock>& found);
  std::vector<cl_uchar> mark_surfels(const Block& first, const Eigen::Array3i& cells, double resolution, const SurfelMap& map);

  Commands& commands_;
  SentArray<cl_uint> pages_;
  DeviceArray<cl_uchar> labels_;
};

}  // namespace frontier_surfels
