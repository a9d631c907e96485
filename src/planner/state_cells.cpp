#include "planner/state_cells.hpp"

#include <algorithm>
#include <map>

#include "planner/regions.hpp"
#include "planner/rounding.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "states";
constexpr int kBlockCells = 16;     // along a block's edge
constexpr double kRegionSize = 16;  // blocks of the map that a region should have along its edge: a view rarely needs more than one

const BlockKey& key_of(const StateCells::FreeQuestion& question) { return question.block; }
const BlockKey& key_of(const StateCells::Marks& marks) { return marks.block; }

/// A part of the grid that is asked for at once.
template <typename Asked>
struct Region {
  BlockKey first = {}, last = {};  ///< its blocks' corners
  std::vector<Asked*> asked;
};

/// @param edge, block_size  of a block of the grid, and of the map [m]
template <typename Asked>
std::vector<Region<Asked>> regions_of(std::vector<Asked>& asked, double edge, double block_size) {
  std::vector<Region<Asked>> regions;
  if (asked.empty()) return regions;
  BlockKey corner = key_of(asked.front());
  for (const Asked& one : asked) {
    const BlockKey& key = key_of(one);
    corner = {std::min(corner.x, key.x), std::min(corner.y, key.y), std::min(corner.z, key.z)};
  }
  const int size = std::max(1, static_cast<int>(kRegionSize * block_size / edge));
  std::map<BlockKey, Region<Asked>> by_place;
  for (Asked& one : asked) {
    const BlockKey& key = key_of(one);
    Region<Asked>& region = by_place[{(key.x - corner.x) / size, (key.y - corner.y) / size, (key.z - corner.z) / size}];
    if (region.asked.empty()) region.first = region.last = key;
    region.first = {std::min(region.first.x, key.x), std::min(region.first.y, key.y), std::min(region.first.z, key.z)};
    region.last = {std::max(region.last.x, key.x), std::max(region.last.y, key.y), std::max(region.last.z, key.z)};
    region.asked.push_back(&one);
  }
  for (auto& [place, region] : by_place) regions.push_back(std::move(region));
  return regions;
}

Eigen::Vector3d corner_of(const BlockKey& block, double edge) { return edge * Eigen::Vector3d(block.x, block.y, block.z); }

/// The blocks of the map that blocks of the grid from `first` to `last` meet.
MapWindow window_of(const BlockKey& first, const BlockKey& last, double edge, double margin, double block_size) {
  const Eigen::Vector3d around = Eigen::Vector3d::Constant(margin);
  return {block_at(corner_of(first, edge) - around, block_size),
          block_at(corner_of(last, edge) + Eigen::Vector3d::Constant(edge) + around, block_size), block_size};
}

}  // namespace

StateCells::StateCells(Commands& commands) : commands_(commands), blocks_(commands), bits_(commands), marks_(commands), pages_(commands) {}

void StateCells::find_free(std::vector<FreeQuestion>& questions, double edge, std::uint64_t after, const KnownWorld& world) {
  const double block_size = world.map.block_size();
  for (const auto& region : regions_of(questions, edge, block_size))
    find_free_in(window_of(region.first, region.last, edge, 1e-6, block_size), region.asked, edge, after, world);
}

void StateCells::find_free_in(const MapWindow& window, const std::vector<FreeQuestion*>& questions, double edge, std::uint64_t after,
                              const KnownWorld& world) {
  std::vector<cl_float4> blocks;
  std::vector<cl_ulong> bits;
  for (const FreeQuestion* question : questions) {
    const Eigen::Vector3f corner = (corner_of(question->block, edge) - window.corner_world()).cast<float>();
    blocks.push_back({{corner.x(), corner.y(), corner.z(), question->may_lose ? 1.0F : 0.0F}});
    bits.insert(bits.end(), question->free->begin(), question->free->end());
  }
  const std::size_t cubes = bits.size();
  blocks_.send(std::move(blocks));
  bits_.send(std::move(bits));
  const int view_count = world.views.prepare(Eigen::Isometry3d(Eigen::Translation3d(window.corner_world())), after);
  const Frame frame = open_window(window, world);
  const SeenPoints &seen = world.seen, &taken = world.taking_back.taken();
  commands_.run(kStage, "find_free_cells", cubes, commands_.shape().heavy_group, frame, world.views.views(), world.views.view_lanes(),
                static_cast<cl_int>(view_count), world.views.depths(), seen.slots(), seen.tables(), seen.brick_words(), taken.slots(),
                taken.tables(), taken.brick_words(), static_cast<cl_float>(edge / kBlockCells), blocks_(),
                static_cast<cl_int>(questions.size()), bits_());
  const std::vector<cl_ulong> found = bits_.read(cubes);
  for (std::size_t n = 0; n < questions.size(); ++n)
    std::copy_n(found.begin() + static_cast<std::ptrdiff_t>(n * STATE_BLOCK_CUBES), STATE_BLOCK_CUBES, questions[n]->free->begin());
}

void StateCells::mark(std::vector<Marks>& asked, double edge, const SurfelMap& map) {
  for (const auto& region : regions_of(asked, edge, map.block_size())) mark_in(region.first, region.last, region.asked, edge, map);
}

/// @param first, last  corners of the region, in blocks of the grid
void StateCells::mark_in(const BlockKey& first, const BlockKey& last, const std::vector<Marks*>& asked, double edge, const SurfelMap& map) {
  const double margin = map.largest_radius() + 1e-6;  // discs reach beyond their block
  std::vector<BlockKey> near;
  for (const Marks* marks : asked) {
    const MapWindow around = window_of(marks->block, marks->block, edge, margin, map.block_size());
    for (int cell = 0; cell < around.cells(); ++cell) near.push_back(around.block(cell));
  }
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  std::vector<cl_uint> pages;
  for (const BlockKey& block : near)
    if (const BlockIndex::Pages* own = map.index().find(block)) pages.insert(pages.end(), own->begin(), own->end());
  if (pages.empty()) return;

  const Eigen::Array3i cells = kBlockCells * Eigen::Array3i((last.x - first.x) / 2 * 2 + 2, last.y - first.y + 1, last.z - first.z + 1);
  const std::size_t words = static_cast<std::size_t>(cells.prod()) / 32;
  marks_.resize(2 * words);
  marks_.fill(kStage, cl_uint{0}, 2 * words);
  const auto page_count = static_cast<cl_int>(pages.size());
  pages_.send(std::move(pages));
  const MapWindow window = window_of(first, last, edge, margin, map.block_size());
  const Eigen::Vector3f shift = (window.corner_world() - corner_of(first, edge)).cast<float>();
  commands_.run(kStage, "mark_state_cells", page_count * (PAGE_SLOTS / commands_.lanes()), kGroup, window.window(),
                cl_float4{{shift.x(), shift.y(), shift.z(), static_cast<float>(edge / kBlockCells)}},
                cl_int4{{cells.x(), cells.y(), cells.z(), 0}}, map.surfels(), map.alive(), map.page_block(), pages_(), page_count,
                marks_());
  const std::vector<cl_uint> found = marks_.read(2 * words);
  for (Marks* marks : asked) {
    const Eigen::Array3i corner =
        kBlockCells * Eigen::Array3i(marks->block.x - first.x, marks->block.y - first.y, marks->block.z - first.z);
    for (int row = 0; row < kBlockCells * kBlockCells; ++row) {
      const std::size_t cell =
          (static_cast<std::size_t>(corner.z() + row / kBlockCells) * cells.y() + corner.y() + row % kBlockCells) * cells.x() + corner.x();
      marks->frontier[row] = static_cast<std::uint16_t>(found[cell / 32] >> cell % 32);
      marks->occupied[row] = static_cast<std::uint16_t>(found[words + cell / 32] >> cell % 32);
    }
  }
}

}  // namespace frontier_surfels
