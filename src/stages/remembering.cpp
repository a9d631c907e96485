#include "stages/remembering.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>

#include "stages/frame.hpp"

namespace frontier_surfels {
namespace {

constexpr const char* kStage = "remembering";

/// Calls visitor(index) for each value that is not 0. Most are 0, and are passed over eight at a time.
template <typename Visitor>
void for_each_not_0(const std::vector<cl_uchar>& values, Visitor visitor) {
  std::uint64_t some = 0;
  for (std::size_t first = 0; first < values.size(); first += sizeof(some)) {
    const std::size_t end = std::min(first + sizeof(some), values.size());
    std::memcpy(&some, &values[first], end - first);
    if (some == 0) continue;
    for (std::size_t n = first; n < end; ++n)
      if (values[n] != 0) visitor(n);
  }
}

}  // namespace

Remembering::Remembering(Commands& commands)
    : commands_(commands), blocks_(commands), seen_by_(commands), found_(commands), states_(commands) {}

/// If the device fails half way, some of the view's points are set, and a second call sets the others and returns the same blocks: bricks
/// that are seen as a whole are told from others only at the end.
std::vector<BlockKey> Remembering::remember(const ForgottenView& view, const RecentViews& views, double block_size, SeenPoints& seen) {
  find_bricks(view, views, block_size, seen);
  take_answer();
  std::vector<BlockKey> changed = set_points(views, seen);
  commands_.wait();
  set_whole(seen);
  settle(seen);
  return changed;
}

std::vector<BlockKey> Remembering::remember_forgotten(RecentViews& views, double block_size, SeenPoints& seen) {
  make_up(views, seen);
  if (!views.forgotten()) return {};
  std::vector<BlockKey> changed = remember(*views.forgotten(), views, block_size, seen);
  views.dismiss_forgotten();
  return changed;
}

void Remembering::ask(const RecentViews& views, double block_size, SeenPoints& seen) {
  make_up(views, seen);
  if (is_asked_) return;
  asked_ = {};
  if (!views.forgotten()) return;
  find_bricks(*views.forgotten(), views, block_size, seen);
  is_asked_ = true;
}

void Remembering::take_answer() {
  is_asked_ = false;
  found_now_ = found_.read(asked_.bricks);
}

std::vector<BlockKey> Remembering::see(RecentViews& views, SeenPoints& seen) {
  if (!views.forgotten()) return {};
  std::vector<BlockKey> changed = set_points(views, seen);
  set_whole(seen);
  views.dismiss_forgotten();
  return changed;
}

void Remembering::clear() {
  is_asked_ = false;
  seen_bricks_.clear();
}

/// What the view adds to each brick of the blocks around it.
void Remembering::find_bricks(const ForgottenView& view, const RecentViews& views, double block_size, SeenPoints& seen) {
  const ViewBlocks around = blocks_of_view(view.intrinsics, view.T_world_camera, view.deepest, block_size);
  asked_ = {views.view_of(view, around.T_camera_local), around.window, {}, 0};
  is_asked_ = false;
  for (const BlockKey& key : around.blocks) {
    const int table = seen.table(key);
    if (seen.is_full(table)) continue;
    asked_.blocks.push_back({{key.x - around.window.origin_x, key.y - around.window.origin_y, key.z - around.window.origin_z, table}});
  }
  if (asked_.blocks.empty()) return;
  seen.send_entries(kStage);
  const auto count = static_cast<cl_int>(asked_.blocks.size());
  asked_.bricks = asked_.blocks.size() * static_cast<std::size_t>(seen.bricks_of_block());
  found_.resize(asked_.bricks);
  blocks_.send(asked_.blocks);
  commands_.run(kStage, "find_seen_bricks", asked_.bricks, kGroup, asked_.window, asked_.view, static_cast<cl_int>(seen.shift()),
                views.depths(), blocks_(), count, seen.tables(), found_());
}

/// Sets the points of the bricks that were found.
std::vector<BlockKey> Remembering::set_points(const RecentViews& views, SeenPoints& seen) {
  const int shift = seen.shift(), sides = (1 << shift) - 1;
  std::vector<cl_int4> seen_by;
  std::vector<Brick> mixed;
  std::vector<BlockKey> changed;
  whole_.clear();
  for_each_not_0(found_now_, [&](std::size_t n) {
    const cl_int4& block = asked_.blocks[n >> 3 * shift];
    const BlockKey key = {asked_.window.origin_x + block.s[0], asked_.window.origin_y + block.s[1], asked_.window.origin_z + block.s[2]};
    if (changed.empty() || changed.back() != key) changed.push_back(key);
    const Brick brick = {block.s[3], static_cast<int>(n & ((std::size_t{1} << 3 * shift) - 1))};
    if (found_now_[n] == SEEN_ALL) return whole_.push_back(brick);
    const cl_int before = seen.entry(brick.table, brick.number);
    const cl_int words = before == SEEN_BRICK_EMPTY ? seen.add_brick(brick.table, brick.number) : before;
    seen_by.push_back({{(block.s[0] << shift) + (brick.number & sides), (block.s[1] << shift) + (brick.number >> shift & sides),
                        (block.s[2] << shift) + (brick.number >> 2 * shift), words}});
    mixed.push_back(brick);
  });
  see_points(views, std::move(seen_by), seen);
  seen_bricks_ = std::move(mixed);
  found_now_ = {};
  return changed;
}

void Remembering::set_whole(SeenPoints& seen) {
  for (const Brick& brick : whole_) seen.set_uniform(brick.table, brick.number, true);
}

void Remembering::see_points(const RecentViews& views, std::vector<cl_int4> seen_by, SeenPoints& seen) {
  if (seen_by.empty()) return;
  seen.send_entries(kStage);
  const auto count = static_cast<cl_int>(seen_by.size());
  const std::size_t cubes = seen.cubes(seen_by.size());
  seen_by_.send(std::move(seen_by));
  states_.resize(count);
  commands_.run(kStage, "see_points", cubes, commands_.shape().heavy_group, asked_.window, asked_.view, static_cast<cl_int>(seen.shift()),
                views.depths(), seen_by_(), count, seen.brick_words());
  find_states(count, seen);
}

void Remembering::find_states(cl_int count, const SeenPoints& seen) {
  commands_.run(kStage, "find_brick_states", count, kGroup, seen_by_(), count, seen.brick_words(), states_());
  states_now_ = states_.read_later(count);
}

/// Ends what a frame that failed has begun: nobody knows whether the states were read. If the view is still to be remembered, the bricks
/// stay as they are: uniform ones would not be found again, nor their blocks returned.
void Remembering::make_up(const RecentViews& views, SeenPoints& seen) {
  if (views.forgotten()) seen_bricks_.clear();
  if (seen_bricks_.empty()) return;
  find_states(static_cast<cl_int>(seen_bricks_.size()), seen);
  commands_.wait();
  settle(seen);
}

void Remembering::settle(SeenPoints& seen) {
  for (std::size_t n = 0; n < seen_bricks_.size(); ++n) {
    const cl_uchar state = (*states_now_)[n];
    if (state != SEEN_MIXED) seen.set_uniform(seen_bricks_[n].table, seen_bricks_[n].number, state == SEEN_ALL);
  }
  seen_bricks_.clear();
}

}  // namespace frontier_surfels
