#include "planner/state_blocks.hpp"

#include <algorithm>

namespace frontier_surfels {
namespace {

/// Discs reach beyond their block.
double reach_of_surfels(const SurfelMap& map) { return map.largest_radius() + 1e-6; }

/// A cell is taken back by the points around its centre, at most this share of a block away: that is the coarsest lattice's spacing.
constexpr double kReachOfPoints = 1.0 / SEEN_BRICK;

std::vector<BlockKey> without_twins(std::vector<BlockKey> keys) {
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

template <typename Words>
bool are_all(const Words& words, typename Words::value_type value) {
  return std::all_of(words.begin(), words.end(), [value](auto word) { return word == value; });
}

CellRows rows_of(const CellBits& bits) {
  constexpr int kEdge = StateBlock::kEdge;
  CellRows rows;
  for (int z = 0; z < kEdge; ++z)
    for (int y = 0; y < kEdge; ++y) {
      const cl_ulong* cubes = &bits[(z / 4 * 4 + y / 4) * 4];
      const int shift = (z % 4 * 4 + y % 4) * 4;
      unsigned row = 0;
      for (int n = 0; n < 4; ++n) row |= static_cast<unsigned>(cubes[n] >> shift & 15) << 4 * n;
      rows[z * kEdge + y] = static_cast<std::uint16_t>(row);
    }
  return rows;
}

/// As StateBlock has them: lower byte first.
void write_rows(const CellRows& rows, std::uint8_t* bytes) {
  for (const std::uint16_t row : rows) {
    *bytes++ = static_cast<std::uint8_t>(row);
    *bytes++ = static_cast<std::uint8_t>(row >> 8);
  }
}

}  // namespace

std::vector<BlockKey> ChangedBlocks::since(std::uint64_t sequence) const {
  std::vector<BlockKey> blocks;
  for (const auto& [block, last] : last_)
    if (last > sequence) blocks.push_back(block);
  std::sort(blocks.begin(), blocks.end());
  return blocks;
}

/// The smallest form: a byte if all cells are alike.
StateBlock StateBlocks::Block::packed(const BlockKey& key) const {
  CellRows is_free = rows_of(free), is_occupied = {};
  if (!surfels.empty()) {
    is_occupied = surfels[1];
    for (std::size_t n = 0; n < is_free.size(); ++n) is_free[n] &= static_cast<std::uint16_t>(~(surfels[0][n] | surfels[1][n]));
  }
  StateBlock packed = {{key.x, key.y, key.z}, {}};
  const auto uniform = [&](SpaceState state) { packed.cells = {static_cast<std::uint8_t>(state)}; };
  if (are_all(is_free, 0xffff))
    uniform(SpaceState::kFree);
  else if (are_all(is_occupied, 0xffff))
    uniform(SpaceState::kOccupied);
  else if (are_all(is_free, 0) && are_all(is_occupied, 0))
    uniform(SpaceState::kUnknown);
  if (!packed.cells.empty()) return packed;
  packed.cells.resize(StateBlock::kBytes);
  write_rows(is_free, packed.cells.data());
  write_rows(is_occupied, packed.cells.data() + StateBlock::kBytes / 2);
  return packed;
}

void StateBlocks::begin(double resolution) {
  blocks_.clear();
  resolution_ = resolution;
  sequence_ = last_view_ = 0;
}

void StateBlocks::update(const std::vector<BlockKey>& map_blocks, const Changed& changed, std::uint64_t sequence, const KnownWorld& world) {
  std::vector<BlockKey> fresh;
  const double margin = reach_of_surfels(world.map), block_size = world.map.block_size();
  for (const auto* some : {&map_blocks, &changed.looked_at, &changed.surfels})
    for (const BlockKey& key : meeting(*some, margin, block_size))
      if (blocks_.emplace(key, Block{}).second) fresh.push_back(key);
  try {
    find_free(fresh, changed, sequence, world);
    find_surfels(fresh, changed.surfels, sequence, world.map);
  } catch (const std::exception&) {
    begin(resolution_);  // also forgets new blocks: what is half up to date is of no use
    throw;
  }
  sequence_ = sequence;
  last_view_ = world.views.current_number();
}

/// The grid's blocks that come within a margin of some blocks of the map, sorted.
std::vector<BlockKey> StateBlocks::meeting(const std::vector<BlockKey>& map_blocks, double margin, double block_size) const {
  std::vector<BlockKey> blocks;
  for (const BlockKey& key : map_blocks) {
    const Eigen::Array3d low = block_size * Eigen::Array3d(key.x, key.y, key.z);
    const Eigen::Array3i first = ((low - margin) / edge()).floor().cast<int>(),
                         last = ((low + block_size + margin) / edge()).floor().cast<int>();
    for (int z = first.z(); z <= last.z(); ++z)
      for (int y = first.y(); y <= last.y(); ++y)
        for (int x = first.x(); x <= last.x(); ++x) blocks.push_back({x, y, z});
  }
  return without_twins(std::move(blocks));
}

/// Blocks of which points were taken are asked for from all views, the others from those that have come since.
void StateBlocks::find_free(const std::vector<BlockKey>& fresh, const Changed& changed, std::uint64_t sequence, const KnownWorld& world) {
  const double block_size = world.map.block_size();
  const std::vector<BlockKey> taken = meeting(changed.taken, kReachOfPoints * block_size, block_size);
  std::vector<StateCells::FreeQuestion> of_all, of_new;
  std::vector<std::pair<Block*, CellBits>> before;
  for (const BlockKey& key : taken)
    if (const auto known = blocks_.find(key); known != blocks_.end()) of_all.push_back({key, &known->second.free, true});
  std::vector<BlockKey> looked_at = meeting(changed.looked_at, 0, block_size);
  looked_at.insert(looked_at.end(), fresh.begin(), fresh.end());
  for (const BlockKey& key : without_twins(std::move(looked_at))) {
    Block& block = blocks_.at(key);
    if (!std::binary_search(taken.begin(), taken.end(), key) && !are_all(block.free, ~cl_ulong{0})) of_new.push_back({key, &block.free});
  }
  for (const BlockKey& key : fresh) blocks_.at(key).changed = sequence;
  for (const auto* questions : {&of_all, &of_new})
    for (const StateCells::FreeQuestion& question : *questions) before.emplace_back(&blocks_.at(question.block), *question.free);
  cells_.find_free(of_all, edge(), 0, world);
  cells_.find_free(of_new, edge(), last_view_, world);
  for (const auto& [block, free] : before)
    if (block->free != free) block->changed = sequence;
}

void StateBlocks::find_surfels(const std::vector<BlockKey>& fresh, const std::vector<BlockKey>& changed, std::uint64_t sequence,
                               const SurfelMap& map) {
  std::vector<BlockKey> keys = meeting(changed, reach_of_surfels(map), map.block_size());
  keys.insert(keys.end(), fresh.begin(), fresh.end());
  std::vector<StateCells::Marks> asked;
  for (const BlockKey& key : without_twins(std::move(keys)))
    if (blocks_.find(key) != blocks_.end()) asked.push_back({key});
  cells_.mark(asked, edge(), map);
  for (const StateCells::Marks& marks : asked) {
    std::vector<CellRows> surfels = {marks.frontier, marks.occupied};
    if (are_all(marks.frontier, 0) && are_all(marks.occupied, 0)) surfels.clear();
    Block& block = blocks_.at(marks.block);
    if (block.surfels == surfels) continue;
    block.surfels = std::move(surfels);
    block.changed = sequence;
  }
}

std::vector<StateBlock> StateBlocks::changes(const std::vector<BlockKey>& map_blocks, std::uint64_t since, const SurfelMap& map) const {
  std::vector<StateBlock> changes;
  for (const BlockKey& key : meeting(map_blocks, reach_of_surfels(map), map.block_size())) {
    const Block& block = blocks_.at(key);
    if (since == 0 || block.changed > since) changes.push_back(block.packed(key));
  }
  return changes;
}

}  // namespace frontier_surfels
