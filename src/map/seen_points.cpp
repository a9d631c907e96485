#include "map/seen_points.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/config_text.hpp"
#include "frontier_surfels/types.hpp"
#include "map/bits.hpp"
#include "map/seen_box.hpp"

namespace frontier_surfels {
namespace {

std::size_t words_for(std::size_t bits) { return (bits + 63) / 64; }

}  // namespace

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
  is_changed_.assign(tables_.size(), false);
  not_empty_.assign(words_for(tables_.size()), 0);
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
    is_changed_.resize(tables_.size(), false);
    not_empty_.resize(words_for(tables_.size()), 0);
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
  const std::uint64_t bit = std::uint64_t{1} << place % 64;
  std::uint64_t& word = not_empty_[place / 64];
  word = value == SEEN_BRICK_EMPTY ? word & ~bit : word | bit;
  tables_[place] = value;
  if (is_changed_[place]) return;
  changed_places_.push_back(static_cast<cl_int>(place));
  is_changed_[place] = true;
}

/// The number of a brick that nothing else uses.
cl_int SeenPoints::take_brick() {
  if (free_.empty()) return static_cast<cl_int>(used_++);
  const cl_int number = free_.back();
  free_.pop_back();
  return number;
}

std::vector<cl_int> SeenPoints::take_bricks(std::size_t count) {
  std::vector<cl_int> numbers(count);
  for (cl_int& number : numbers) number = take_brick();
  return numbers;
}

cl_int SeenPoints::add_brick(int table, int brick) {
  const cl_int number = take_brick();
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
  std::vector<cl_int2> entries;
  entries.reserve(changed_places_.size());
  for (const cl_int place : changed_places_) entries.push_back({{place, tables_[place]}});
  const auto count = static_cast<cl_int>(entries.size());
  entries_.send(std::move(entries));
  commands_.run(stage, "set_seen_entries", count, kGroup, entries_(), count, tables_on_device_());
  for (const cl_int place : changed_places_) is_changed_[place] = false;
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

/// Calls visitor(first brick, word) for the bits of not_empty_ that belong to a block, up to 64 in a word. Most words are 0.
template <typename Visitor>
void SeenPoints::for_each_word(int table, Visitor visitor) const {
  const std::size_t first = at(table, 0);
  if (bricks_of_block() < 64) return visitor(0, not_empty_[first / 64] >> first % 64 & ((std::uint64_t{1} << bricks_of_block()) - 1));
  for (int brick = 0; brick < bricks_of_block(); brick += 64) visitor(brick, not_empty_[(first + brick) / 64]);
}

std::vector<int> SeenPoints::bricks_with_points(int table) const {
  std::vector<int> bricks;
  for_each_word(table, [&](int first, std::uint64_t word) {
    for_each_bit(word, [&](std::uint32_t bit) { bricks.push_back(first + static_cast<int>(bit)); });
  });
  return bricks;
}

bool SeenPoints::has_points(int table) const {
  std::uint64_t any = 0;
  for_each_word(table, [&](int, std::uint64_t word) { any |= word; });
  return any != 0;
}

std::size_t SeenPoints::bytes() const {
  return SEEN_WORDS * sizeof(cl_ulong) * used_ + 2 * sizeof(cl_int) * tables_.size() + table_of_.bytes();
}

}  // namespace frontier_surfels
