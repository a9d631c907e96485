#include "stages/remembering.hpp"

#include <utility>

#include "map/view_blocks.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "remembering";

}  // namespace

Remembering::Remembering(Commands& commands)
    : commands_(commands), blocks_(commands), seen_by_(commands), found_(commands), states_(commands) {}

/// If the device fails half way, some of the view's points are set, and a second call sets the others and returns the same blocks: bricks
/// that are seen as a whole are told from others only at the end.
std::vector<BlockKey> Remembering::remember(const ForgottenView& forgotten, const RecentViews& views, double block_size, SeenPoints& seen) {
  const ViewBlocks around = blocks_of_view(forgotten.intrinsics, forgotten.T_world_camera, forgotten.deepest, block_size);
  const View view = views.view_of(forgotten, around.T_camera_local);
  std::vector<cl_int4> blocks;
  for (const BlockKey& key : around.blocks) {
    const int table = seen.table(key);
    if (seen.is_full(table)) continue;
    blocks.push_back({{key.x - around.window.origin_x, key.y - around.window.origin_y, key.z - around.window.origin_z, table}});
  }
  const std::vector<cl_uchar> found = find_bricks(around.window, view, views, blocks, seen);

  // Bricks that are seen as a whole, and those whose points must be asked for, each with its place in the tables
  const int bricks = seen.bricks_of_block(), sides = (1 << seen.shift()) - 1;
  std::vector<cl_int4> asked;
  std::vector<std::pair<int, int>> whole, places;
  std::vector<BlockKey> changed;
  for (std::size_t n = 0; n < found.size(); ++n) {
    if (found[n] == SEEN_NONE) continue;
    const cl_int4& block = blocks[n / bricks];
    const BlockKey key = {around.window.origin_x + block.s[0], around.window.origin_y + block.s[1], around.window.origin_z + block.s[2]};
    if (changed.empty() || changed.back() != key) changed.push_back(key);
    const int table = block.s[3], brick = static_cast<int>(n % bricks);
    if (found[n] == SEEN_ALL) {
      whole.emplace_back(table, brick);
      continue;
    }
    const cl_int before = seen.entry(table, brick);
    const cl_int number = before == SEEN_BRICK_EMPTY ? seen.add_brick(table, brick) : before;
    asked.push_back({{(block.s[0] << seen.shift()) + (brick & sides), (block.s[1] << seen.shift()) + (brick >> seen.shift() & sides),
                      (block.s[2] << seen.shift()) + (brick >> 2 * seen.shift()), number}});
    places.emplace_back(table, brick);
  }
  const std::vector<cl_uchar> states = see_points(around.window, view, views, std::move(asked), seen);
  for (const auto& [table, brick] : whole) seen.set_uniform(table, brick, true);
  for (std::size_t n = 0; n < states.size(); ++n)
    if (states[n] != SEEN_MIXED) seen.set_uniform(places[n].first, places[n].second, states[n] == SEEN_ALL);
  return changed;
}

std::vector<BlockKey> Remembering::remember_forgotten(RecentViews& views, double block_size, SeenPoints& seen) {
  if (!views.forgotten()) return {};
  std::vector<BlockKey> changed = remember(*views.forgotten(), views, block_size, seen);
  views.dismiss_forgotten();
  return changed;
}

/// What the view adds to each brick of some blocks.
std::vector<cl_uchar> Remembering::find_bricks(const Window& window, const View& view, const RecentViews& views,
                                               const std::vector<cl_int4>& blocks, SeenPoints& seen) {
  if (blocks.empty()) return {};
  seen.send_entries(kStage);
  const std::size_t bricks = blocks.size() * static_cast<std::size_t>(seen.bricks_of_block());
  found_.resize(bricks);
  blocks_.send(blocks);
  commands_.run(kStage, "find_seen_bricks", bricks, kGroup, window, view, static_cast<cl_int>(seen.shift()), views.depths(), blocks_(),
                static_cast<cl_int>(blocks.size()), seen.tables(), found_());
  return found_.read(bricks);
}

/// Sets the points of bricks. @return state of each brick after that
std::vector<cl_uchar> Remembering::see_points(const Window& window, const View& view, const RecentViews& views, std::vector<cl_int4> asked,
                                              SeenPoints& seen) {
  if (asked.empty()) return {};
  seen.send_entries(kStage);
  const auto count = static_cast<cl_int>(asked.size());
  const std::size_t cubes = seen.cubes(asked.size());
  seen_by_.send(std::move(asked));
  states_.resize(count);
  commands_.run(kStage, "see_points", cubes, commands_.shape().heavy_group, window, view, static_cast<cl_int>(seen.shift()), views.depths(),
                seen_by_(), count, seen.brick_words());
  commands_.run(kStage, "find_brick_states", count, kGroup, seen_by_(), count, seen.brick_words(), states_());
  return states_.read(count);
}

}  // namespace frontier_surfels
