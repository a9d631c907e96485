#include "map/seen_points.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "config/config_text.hpp"
#include "frontier_surfels/types.hpp"
#include "map/seen_block.hpp"
#include "map/seen_box.hpp"

namespace frontier_surfels {
namespace {

constexpr int kMostShift = 4;  // 16 bricks, hence 256 points, along a block's edge: a block's table takes 16 kB
constexpr std::size_t kGroup = 64;
}  // namespace

void SeenPoints::check(const SeenSpace& seen) {
  int shift = 0;
  while (shift < kMostShift && SEEN_BRICK << shift < seen.points) ++shift;
  if (seen.points != SEEN_BRICK << shift)
    throw FileError("What has been seen has " + std::to_string(seen.points) +
                    " points along a block's edge, which is no power of two from 16 to 256: use another copy of the map.");
  for (const SeenSpace::Block& block : seen.blocks) check_seen_block(block.bytes, std::size_t{1} << (3 * shift));
}

void SeenPoints::load(const SeenSpace& seen) {
  check(seen);
  choose_shift(static_cast<int>(std::lround(std::log2(seen.points / SEEN_BRICK))));
  fixed_ = false;  // if nothing was seen, the next frame may choose another one
  std::vector<SeenBlock> blocks;
  for (const SeenSpace::Block& block : seen.blocks) blocks.push_back({{block.block[0], block.block[1], block.block[2]}, block.bytes});
  add_blocks(blocks);
}

SeenSpace SeenPoints::saved() {
  SeenSpace seen;
  seen.block_size = block_size_;
  seen.points = SEEN_BRICK << shift_;
  const std::vector<BlockKey> blocks = blocks_with_points();
  std::vector<std::vector<std::uint8_t>> bytes = read_blocks(blocks);
  for (std::size_t n = 0; n < blocks.size(); ++n) seen.blocks.push_back({{blocks[n].x, blocks[n].y, blocks[n].z}, std::move(bytes[n])});
  return seen;
}

SeenPoints::SeenPoints(Commands& commands, double block_size)
    : commands_(commands),
      block_size_(block_size),
      slots_(commands),
      entries_(commands),
      new_bricks_list_(commands),
      tables_on_device_(commands),
      bricks_(commands),
      gathered_(commands),
      gathered_list_(commands) {
  clear();
  send_entries("changes");
  window_tables_ = std::make_shared<const std::vector<cl_int>>(1, 0);
  slots_.send(window_tables_);
}

/// The device gets it with the next send_entries().
void SeenPoints::clear() {
  fixed_ = false;
  table_of_ = {};
  tables_.assign(bricks_of_block(), SEEN_BRICK_EMPTY);
  full_bricks_.assign(1, 0);
  free_tables_.clear();
  free_.clear();
  used_ = 2;
  changed_places_.clear();
  new_bricks_.clear();
  sent_tables_ = 0;
}

void SeenPoints::choose_spacing(double spacing) {
  const int shift = shift_for_spacing(block_size_, spacing);
  if (fixed_ || shift == shift_) return;
  shift_ = shift;
  clear();
}

void SeenPoints::choose_shift(int shift) {
  shift_ = std::clamp(shift, 0, kMostShift);
  clear();
  fixed_ = true;
}

void SeenPoints::warn_of_spacing(double spacing, std::vector<std::string>* warnings) const {
  if (!fixed_ || spacing == 0 || shift_for_spacing(block_size_, spacing) == shift_) return;
  warnings->push_back("seen_spacing is " + to_text(spacing) + " m, but this map has remembered what was seen at points " +
                      to_text(this->spacing()) + " m apart, and goes on with these: set seen_spacing to 0, or begin a new map.");
}

int SeenPoints::shift_for_spacing(double block_size, double spacing) {
  const double bricks = block_size / (SEEN_BRICK * spacing);
  return std::clamp(static_cast<int>(std::ceil(std::log2(bricks) - 1e-9)), 0, kMostShift);
}

double SeenPoints::spacing() const { return block_size_ / (SEEN_BRICK << shift_); }

void SeenPoints::open_window(const MapWindow& window) {
  send_entries("remembering");
  auto tables = std::make_shared<std::vector<cl_int>>(window.cells(), 0);
  table_of_.for_each_in(window.window(), [&](int cell, const BlockKey&, int table) { (*tables)[cell] = table; });
  window_tables_ = std::move(tables);
  slots_.send(window_tables_);
}

int SeenPoints::table(const BlockKey& block) {
  if (const int* found = table_of_.find(block); found != nullptr) return *found;
  int number = static_cast<int>(full_bricks_.size());
  if (free_tables_.empty()) {
    full_bricks_.push_back(0);
    tables_.resize(tables_.size() + bricks_of_block(), SEEN_BRICK_EMPTY);
  } else {
    number = free_tables_.back();
    free_tables_.pop_back();
  }
  table_of_.at_or_new(block) = number;
  fixed_ = true;  // also when all blocks have moved to the archive
  return number;
}

void SeenPoints::set_entry(int table, int brick, cl_int value) {
  const std::size_t place = at(table, brick);
  full_bricks_[table] += (value == SEEN_BRICK_FULL ? 1 : 0) - (tables_[place] == SEEN_BRICK_FULL ? 1 : 0);
  tables_[place] = value;
  changed_places_.push_back(static_cast<cl_int>(place));
}

/// Numbers of bricks that nothing else uses.
std::vector<cl_int> SeenPoints::take_bricks(std::size_t count) {
  std::vector<cl_int> numbers;
  for (std::size_t n = 0; n < count; ++n) {
    if (free_.empty()) {
      numbers.push_back(static_cast<cl_int>(used_++));
    } else {
      numbers.push_back(free_.back());
      free_.pop_back();
    }
  }
  return numbers;
}

cl_int SeenPoints::add_brick(int table, int brick) {
  const cl_int number = take_bricks(1).front();
  new_bricks_.push_back(number);
  set_entry(table, brick, number);
  return number;
}

cl_int SeenPoints::own_brick(int table, int brick) {
  const cl_int before = entry(table, brick);
  if (before > SEEN_BRICK_FULL) return before;
  if (before == SEEN_BRICK_EMPTY) return add_brick(table, brick);
  const std::vector<cl_int> number = take_bricks(1);
  try {
    bricks_.grow(SEEN_WORDS * used_, bricks_.size());
    bricks_.fill("taking_back", ~cl_ulong{0}, SEEN_WORDS, static_cast<std::size_t>(SEEN_WORDS) * number.front());
  } catch (...) {
    give_back(number);
    throw;
  }
  set_entry(table, brick, number.front());
  return number.front();
}

void SeenPoints::set_uniform(int table, int brick, bool seen) {
  const cl_int before = entry(table, brick), after = seen ? SEEN_BRICK_FULL : SEEN_BRICK_EMPTY;
  if (before == after) return;
  if (before > SEEN_BRICK_FULL) free_.push_back(before);
  set_entry(table, brick, after);
}

/// What could not be sent waits for the next call.
void SeenPoints::send_entries(const char* stage) {
  if (sent_tables_ == 0) {
    std::vector<cl_ulong> uniform(2 * SEEN_WORDS, 0);
    std::fill(uniform.begin() + SEEN_WORDS, uniform.end(), ~cl_ulong{0});
    bricks_.write(uniform);
  }
  if (tables_.size() > sent_tables_) {
    tables_on_device_.grow(tables_.size(), sent_tables_);
    tables_on_device_.send(std::vector<cl_int>(tables_.begin() + sent_tables_, tables_.end()), sent_tables_);
    sent_tables_ = tables_.size();
  }
  if (!new_bricks_.empty()) {
    bricks_.grow(SEEN_WORDS * used_, bricks_.size());
    new_bricks_list_.send(new_bricks_);
    commands_.run(stage, "empty_bricks", SEEN_WORDS * new_bricks_.size(), kGroup, new_bricks_list_(),
                  static_cast<cl_int>(new_bricks_.size()), bricks_());
    new_bricks_.clear();
  }
  if (changed_places_.empty()) return;
  std::sort(changed_places_.begin(), changed_places_.end());
  changed_places_.erase(std::unique(changed_places_.begin(), changed_places_.end()), changed_places_.end());
  std::vector<cl_int2> entries;
  for (const cl_int place : changed_places_) entries.push_back({{place, tables_[place]}});
  const auto count = static_cast<cl_int>(entries.size());
  entries_.send(std::move(entries));
  commands_.run(stage, "set_seen_entries", count, kGroup, entries_(), count, tables_on_device_());
  changed_places_.clear();
}

/// The bricks that a box has a part of. Those without a brick of their own get no number. @param whole  gets those that lie in it as a
/// whole
std::vector<SeenPoints::PartlyForgotten> SeenPoints::bricks_in(const Eigen::AlignedBox3d& box,
                                                               std::vector<std::pair<int, int>>& whole) const {
  const PointRange points = points_in(box, spacing());
  std::vector<PartlyForgotten> partly;
  for (const BlockKey& key : blocks())
    for (int brick = 0; brick < bricks_of_block(); ++brick) {
      const int table = *table_of_.find(key);
      const cl_int own = entry(table, brick);
      const PointRange inside = points.in_brick(key, shift_, brick);
      if (inside.empty() || own == SEEN_BRICK_EMPTY) continue;
      if ((inside.first == 0).all() && (inside.end == SEEN_BRICK).all())
        whole.emplace_back(table, brick);
      else
        partly.push_back({table, brick, own, own == SEEN_BRICK_FULL, inside.first, inside.end});
    }
  return partly;
}

void SeenPoints::forget(const Eigen::AlignedBox3d& box) {
  send_entries("forgetting");
  std::vector<std::pair<int, int>> whole;
  std::vector<PartlyForgotten> partly = bricks_in(box, whole);
  const auto full = std::count_if(partly.begin(), partly.end(), [](const PartlyForgotten& p) { return p.was_full; });
  const std::vector<cl_int> numbers = take_bricks(static_cast<std::size_t>(full));
  auto next = numbers.begin();
  for (PartlyForgotten& p : partly)
    if (p.was_full) p.number = *next++;
  std::vector<cl_uchar> empty;
  try {
    empty = forget_points(partly);
  } catch (...) {
    give_back(numbers);
    throw;
  }
  for (const auto& [table, brick] : whole) set_uniform(table, brick, false);
  for (std::size_t n = 0; n < partly.size(); ++n) {
    if (partly[n].was_full) set_entry(partly[n].table, partly[n].brick, partly[n].number);
    if (empty[n]) set_uniform(partly[n].table, partly[n].brick, false);
  }
}

/// @return whether no point of each brick is seen any more
std::vector<cl_uchar> SeenPoints::forget_points(const std::vector<PartlyForgotten>& partly) {
  if (partly.empty()) return {};
  std::vector<cl_int8> ranges;
  for (const PartlyForgotten& p : partly)
    ranges.push_back({{p.first.x(), p.first.y(), p.first.z(), p.number, p.last.x(), p.last.y(), p.last.z(), p.was_full ? 1 : 0}});
  const auto count = static_cast<cl_int>(ranges.size());
  DeviceArray<cl_int8> on_device(commands_);
  DeviceArray<cl_uchar> empty(commands_);
  bricks_.grow(SEEN_WORDS * used_, bricks_.size());
  on_device.write(ranges);
  empty.resize(ranges.size());
  commands_.run("forgetting", "forget_points", SEEN_WORDS * ranges.size(), kGroup, on_device(), count, bricks_());
  commands_.run("forgetting", "find_empty_bricks", ranges.size(), kGroup, on_device(), count, bricks_(), empty());
  return empty.read(ranges.size());
}

std::vector<BlockKey> SeenPoints::blocks() const {
  std::vector<BlockKey> blocks;
  for (const auto& [block, table] : table_of_.table()) blocks.push_back(block);
  std::sort(blocks.begin(), blocks.end());
  return blocks;
}

/// A block has up to 4096 bricks, most of them without points: these are passed over many at a time.
std::vector<int> SeenPoints::bricks_with_points(int table) const {
  constexpr int kMany = 64;
  const cl_int* entries = &tables_[at(table, 0)];
  std::vector<int> bricks;
  for (int first = 0; first < bricks_of_block(); first += kMany) {
    const int end = std::min(first + kMany, bricks_of_block());
    if (std::count(entries + first, entries + end, SEEN_BRICK_EMPTY) == end - first) continue;
    for (int brick = first; brick < end; ++brick)
      if (entries[brick] != SEEN_BRICK_EMPTY) bricks.push_back(brick);
  }
  return bricks;
}

std::vector<BlockKey> SeenPoints::blocks_with_points() const {
  std::vector<BlockKey> blocks;
  for (const auto& [block, table] : table_of_.table()) {
    const auto begin = tables_.begin() + at(table, 0);
    if (std::any_of(begin, begin + bricks_of_block(), [](cl_int entry) { return entry != SEEN_BRICK_EMPTY; })) blocks.push_back(block);
  }
  std::sort(blocks.begin(), blocks.end());
  return blocks;
}

std::vector<std::vector<std::uint8_t>> SeenPoints::read_blocks(const std::vector<BlockKey>& blocks) {
  send_entries("changes");
  const int bricks = bricks_of_block();
  std::vector<std::vector<std::uint8_t>> stored(blocks.size());
  std::vector<cl_int> mixed;
  for (std::size_t n = 0; n < blocks.size(); ++n) {
    const int* table = table_of_.find(blocks[n]);
    if (table == nullptr) continue;
    bool any = false;
    for (int brick = 0; brick < bricks; ++brick) {
      const cl_int number = entry(*table, brick);
      any = any || number != SEEN_BRICK_EMPTY;
      stored[n].push_back(number == SEEN_BRICK_EMPTY ? SEEN_NONE : number == SEEN_BRICK_FULL ? SEEN_ALL : SEEN_MIXED);
      if (number > SEEN_BRICK_FULL) mixed.push_back(number);
    }
    if (!any) stored[n].clear();
  }
  if (mixed.empty()) return stored;
  const std::size_t words = SEEN_WORDS * mixed.size();
  const auto count = static_cast<cl_int>(mixed.size());
  gathered_.resize(words);
  gathered_list_.send(std::move(mixed));
  commands_.run("changes", "gather_bricks", words, kGroup, gathered_list_(), count, bricks_(), gathered_());
  const std::vector<cl_ulong> gathered = gathered_.read(words);
  const auto* next = reinterpret_cast<const std::uint8_t*>(gathered.data());
  for (std::vector<std::uint8_t>& bytes : stored) {
    const std::size_t own = kBrickBytes * static_cast<std::size_t>(std::count(bytes.begin(), bytes.end(), SEEN_MIXED));
    bytes.insert(bytes.end(), next, next + own);
    next += own;
  }
  return stored;
}

void SeenPoints::add_blocks(const std::vector<SeenBlock>& blocks) {
  const auto bricks = static_cast<std::size_t>(bricks_of_block());
  std::vector<cl_ulong> words;
  for (const auto& [block, bytes] : blocks) {
    check_seen_block(bytes, bricks);
    if (bytes.size() <= bricks) continue;
    const std::size_t before = words.size();
    words.resize(before + (bytes.size() - bricks) / sizeof(cl_ulong));
    std::memcpy(&words[before], &bytes[bricks], bytes.size() - bricks);
  }
  send_entries("changes");
  const std::vector<cl_int> numbers = take_bricks(words.size() / SEEN_WORDS);
  try {
    scatter(numbers, words);
  } catch (...) {
    give_back(numbers);
    throw;
  }
  auto next = numbers.begin();  // nothing can fail from here on
  for (const auto& [block, bytes] : blocks) {
    drop_block(block);
    if (bytes.empty()) continue;
    const int own = table(block);
    for (std::size_t brick = 0; brick < bricks; ++brick) {
      if (bytes[brick] == SEEN_ALL) set_uniform(own, static_cast<int>(brick), true);
      if (bytes[brick] == SEEN_MIXED) set_entry(own, static_cast<int>(brick), *next++);
    }
  }
}

/// Writes the words of bricks that no entry has yet.
void SeenPoints::scatter(std::vector<cl_int> numbers, const std::vector<cl_ulong>& words) {
  if (numbers.empty()) return;
  const auto count = static_cast<cl_int>(numbers.size());
  bricks_.grow(SEEN_WORDS * used_, bricks_.size());
  gathered_.write(words);
  gathered_list_.send(std::move(numbers));
  commands_.run("changes", "scatter_bricks", words.size(), kGroup, gathered_list_(), count, gathered_(), bricks_());
}

/// The change of the tables waits for the next send_entries(): until then no table sent by open_window() has the block.
void SeenPoints::drop_block(const BlockKey& block) {
  const int* found = table_of_.find(block);
  if (found == nullptr) return;
  const int table = *found;
  for (int brick = 0; brick < bricks_of_block(); ++brick) {
    const cl_int number = entry(table, brick);
    if (number == SEEN_BRICK_EMPTY) continue;
    if (number > SEEN_BRICK_FULL) free_.push_back(number);
    set_entry(table, brick, SEEN_BRICK_EMPTY);
  }
  free_tables_.push_back(table);
  table_of_.erase(block);
}

std::size_t SeenPoints::bytes() const {
  return SEEN_WORDS * sizeof(cl_ulong) * used_ + 2 * sizeof(cl_int) * tables_.size() + table_of_.bytes();
}

}  // namespace frontier_surfels
