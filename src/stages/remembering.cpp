#include "stages/remembering.hpp"

#include <utility>

#include "map/view_blocks.hpp"
#include "stages/frame.hpp"

namespace frontier_surfels {

Remembering::Remembering(Commands& commands)
    : commands_(commands), blocks_(commands), seen_by_(commands), found_(commands), states_(commands) {}

std::vector<BlockKey> Remembering::remember(const ForgottenView& forgotten, const RecentViews& views, double block_size, SeenPoints& seen) {
  const char* stage = "remembering";
  const ViewBlocks around = blocks_of_view(forgotten.intrinsics, forgotten.T_world_camera, forgotten.deepest, block_size);
  std::vector<cl_int4> blocks;
  for (const BlockKey& key : around.blocks) {
    const int table = seen.table(key);
    if (seen.is_full(table)) continue;
    blocks.push_back({{key.x - around.window.origin_x, key.y - around.window.origin_y, key.z - around.window.origin_z, table}});
  }
  if (blocks.empty()) return {};
  seen.send_entries(stage);

  // What the view adds to each brick
  const View view = views.view_of(forgotten, around.T_camera_local);
  const int bricks = seen.bricks_of_block(), sides = (1 << seen.shift()) - 1;
  const std::size_t count = blocks.size();
  found_.resize(count * bricks);
  blocks_.send(blocks);
  commands_.run(stage, "find_seen_bricks", count * bricks, kGroup, around.window, view, static_cast<cl_int>(seen.shift()), views.depths(),
                blocks_(), static_cast<cl_int>(count), seen.tables(), found_());
  const std::vector<cl_uchar> found = found_.read(count * bricks);

  // Bricks whose points must be asked for, each with its place in the tables
  std::vector<cl_int4> asked;
  std::vector<std::pair<int, int>> places;
  std::vector<BlockKey> changed;
  for (std::size_t n = 0; n < found.size(); ++n) {
    if (found[n] == SEEN_NONE) continue;
    const cl_int4& block = blocks[n / bricks];
    const BlockKey key = {around.window.origin_x + block.s[0], around.window.origin_y + block.s[1], around.window.origin_z + block.s[2]};
    if (changed.empty() || changed.back() != key) changed.push_back(key);
    const int table = block.s[3], brick = static_cast<int>(n % bricks);
    if (found[n] == SEEN_ALL) {
      seen.set_uniform(table, brick, true);
      continue;
    }
    const cl_int before = seen.entry(table, brick);
    const cl_int number = before == SEEN_BRICK_EMPTY ? seen.add_brick(table, brick) : before;
    asked.push_back({{(block.s[0] << seen.shift()) + (brick & sides), (block.s[1] << seen.shift()) + (brick >> seen.shift() & sides),
                      (block.s[2] << seen.shift()) + (brick >> 2 * seen.shift()), number}});
    places.emplace_back(table, brick);
  }
  seen.send_entries(stage);
  if (asked.empty()) return changed;
  const auto asked_count = static_cast<cl_int>(asked.size());
  seen_by_.send(std::move(asked));
  commands_.run(stage, "see_points", static_cast<std::size_t>(asked_count) * (commands_.lanes() == 1 ? SEEN_WORDS : SEEN_WORDS / 8),
                commands_.device().heavy_group(), around.window, view, static_cast<cl_int>(seen.shift()), views.depths(), seen_by_(),
                asked_count, seen.brick_words());
  states_.resize(asked_count);
  commands_.run(stage, "find_brick_states", asked_count, kGroup, seen_by_(), asked_count, seen.brick_words(), states_());
  const std::vector<cl_uchar> states = states_.read(asked_count);
  for (std::size_t n = 0; n < states.size(); ++n)
    if (states[n] != SEEN_MIXED) seen.set_uniform(places[n].first, places[n].second, states[n] == SEEN_ALL);
  return changed;
}

}  // namespace frontier_surfels
