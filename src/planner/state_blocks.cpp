#include "planner/state_blocks.hpp"

#include <algorithm>
#include <map>
#include <set>

#include "map/map_window.hpp"
#include "planner/regions.hpp"
#include "planner/rounding.hpp"
#include "planner/surfel_cells.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "states";
constexpr int kEdge = StateBlock::kEdge;
constexpr int kRegion = 4;  // blocks of the grid along the edge of what is found at once

/// The smallest form of a block: a byte if all cells are alike.
StateBlock packed(const std::array<std::int32_t, 3>& block, const std::vector<SpaceState>& cells) {
  StateBlock packed = {block, {static_cast<std::uint8_t>(cells.front())}};
  if (std::all_of(cells.begin(), cells.end(), [&](SpaceState state) { return state == cells.front(); })) return packed;
  packed.cells.assign(StateBlock::kBytes, 0);
  for (std::size_t n = 0; n < cells.size(); ++n) {
    const auto bit = static_cast<std::uint8_t>(1 << n % 8);
    if (cells[n] == SpaceState::kFree) packed.cells[n / 8] |= bit;
    if (cells[n] == SpaceState::kOccupied) packed.cells[StateBlock::kBytes / 2 + n / 8] |= bit;
  }
  return packed;
}

}  // namespace

std::vector<BlockKey> LookedAt::since(std::uint64_t sequence) const {
  std::vector<BlockKey> blocks;
  for (const auto& [block, last] : last_)
    if (last > sequence) blocks.push_back(block);
  std::sort(blocks.begin(), blocks.end());
  return blocks;
}

StateBlocks::StateBlocks(Commands& commands) : commands_(commands), pages_(commands), labels_(commands) {}

std::vector<StateBlock> StateBlocks::find(const std::vector<BlockKey>& map_blocks, double resolution, PointStates& states,
                                          const KnownWorld& world) {
  const double block_size = world.map.block_size(), edge = kEdge * resolution;
  const double margin = world.map.largest_radius() + 1e-6;  // discs reach beyond their block
  std::map<Block, std::set<Block>> regions;
  for (const BlockKey& key : map_blocks) {
    const Eigen::Array3d low = block_size * Eigen::Array3d(key.x, key.y, key.z);
    const Eigen::Array3i first = ((low - margin) / edge).floor().cast<int>(),
                         last = ((low + block_size + margin) / edge).floor().cast<int>();
    for (int z = first.z(); z <= last.z(); ++z)
      for (int y = first.y(); y <= last.y(); ++y)
        for (int x = first.x(); x <= last.x(); ++x)
          regions[{divide_down(x, kRegion), divide_down(y, kRegion), divide_down(z, kRegion)}].insert({x, y, z});
  }
  std::vector<StateBlock> found;
  for (const auto& [region, blocks] : regions) find_some({blocks.begin(), blocks.end()}, resolution, states, world, found);
  std::sort(found.begin(), found.end(), [](const StateBlock& a, const StateBlock& b) { return a.block < b.block; });
  return found;
}

void StateBlocks::find_some(const std::vector<Block>& blocks, double resolution, PointStates& states, const KnownWorld& world,
                            std::vector<StateBlock>& found) {
  std::vector<Eigen::Vector3f> centres;
  centres.reserve(blocks.size() * StateBlock::kCells);
  Block first = blocks.front(), last = blocks.front();
  for (const Block& block : blocks) {
    for (int axis = 0; axis < 3; ++axis) {
      first[axis] = std::min(first[axis], block[axis]);
      last[axis] = std::max(last[axis], block[axis]);
    }
    for (int n = 0; n < StateBlock::kCells; ++n) {
      const Eigen::Array3d cell(kEdge * block[0] + n % kEdge, kEdge * block[1] + n / kEdge % kEdge, kEdge * block[2] + n / (kEdge * kEdge));
      centres.push_back(((cell + 0.5) * resolution).matrix().cast<float>());
    }
  }
  const std::vector<SpaceState> of_centres = states.find_free(centres, world);
  const Eigen::Array3i cells = kEdge * Eigen::Array3i(last[0] - first[0] + 1, last[1] - first[1] + 1, last[2] - first[2] + 1);
  const std::vector<cl_uchar> labels = mark_surfels(first, cells, resolution, world.map);
  const std::size_t count = static_cast<std::size_t>(cells.prod());
  std::vector<SpaceState> of_block(StateBlock::kCells);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const Eigen::Array3i corner = kEdge * Eigen::Array3i(blocks[b][0] - first[0], blocks[b][1] - first[1], blocks[b][2] - first[2]);
    for (int n = 0; n < StateBlock::kCells; ++n) {
      const Eigen::Array3i cell = corner + Eigen::Array3i(n % kEdge, n / kEdge % kEdge, n / (kEdge * kEdge));
      const std::size_t at = (static_cast<std::size_t>(cell.z()) * cells.y() + cell.y()) * cells.x() + cell.x();
      of_block[n] = labels[count + at] != 0 ? SpaceState::kOccupied
                    : labels[at] != 0       ? SpaceState::kUnknown
                                            : of_centres[b * StateBlock::kCells + n];
    }
    found.push_back(packed(blocks[b], of_block));
  }
}

/// Where surfels pass. @param first  block at the corner. @param cells  along each axis
/// @return [2][z][y][x]: cells with a frontier surfel, cells with an occupied one
std::vector<cl_uchar> StateBlocks::mark_surfels(const Block& first, const Eigen::Array3i& cells, double resolution, const SurfelMap& map) {
  const Eigen::Vector3d low = kEdge * resolution * Eigen::Vector3d(first[0], first[1], first[2]),
                        high = low + resolution * cells.cast<double>().matrix();
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(map.largest_radius() + 1e-6);
  const MapWindow window(block_at(low - margin, map.block_size()), block_at(high + margin, map.block_size()), map.block_size());
  std::vector<cl_uint> pages = pages_of(window, map.index());
  const std::size_t count = 2 * static_cast<std::size_t>(cells.prod());
  if (pages.empty()) return std::vector<cl_uchar>(count, 0);
  labels_.resize(count);
  labels_.fill(kStage, cl_uchar{0}, count);
  const auto page_count = static_cast<cl_int>(pages.size());
  pages_.send(std::move(pages));
  const Eigen::Vector3f shift = (window.corner_world() - low).cast<float>();
  commands_.run(kStage, "mark_state_cells", page_count * (PAGE_SLOTS / commands_.lanes()), kGroup, window.window(),
                cl_float4{{shift.x(), shift.y(), shift.z(), static_cast<float>(resolution)}}, cl_int4{{cells.x(), cells.y(), cells.z(), 0}},
                map.surfels(), map.alive(), map.page_block(), pages_(), page_count, labels_());
  return labels_.read(count);
}

}  // namespace frontier_surfels
