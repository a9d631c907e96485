#include "map/seen_points.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

constexpr int kMostShift = 6;  // 64 bricks, hence 1024 points, along a block's edge
constexpr std::size_t kGroup = 64;

}  // namespace

SeenPoints::SeenPoints(Commands& commands, double block_size)
    : commands_(commands), block_size_(block_size), slots_(commands), entries_(commands), tables_on_device_(commands), bricks_(commands) {
  clear();
}

void SeenPoints::clear() {
  table_of_.clear();
  tables_.assign(bricks_of_block(), SEEN_BRICK_EMPTY);
  full_bricks_.assign(1, 0);
  free_.clear();
  used_ = 2;
  changed_entries_.clear();
  tables_on_device_.write(tables_);
  sent_tables_ = tables_.size();
  std::vector<cl_ulong> uniform(2 * SEEN_WORDS, 0);
  std::fill(uniform.begin() + SEEN_WORDS, uniform.end(), ~cl_ulong{0});
  bricks_.write(uniform);
  slots_.send({0});
}

void SeenPoints::choose_spacing(double spacing) {
  if (!empty()) return;
  const double bricks = block_size_ / (SEEN_BRICK * spacing);
  const int shift = std::clamp(static_cast<int>(std::ceil(std::log2(bricks) - 1e-9)), 0, kMostShift);
  if (shift == shift_) return;
  shift_ = shift;
  clear();
}

double SeenPoints::spacing() const { return block_size_ / (SEEN_BRICK << shift_); }

void SeenPoints::open_window(const MapWindow& window) {
  std::vector<cl_int> slots(window.cells(), 0);
  for (int cell = 0; cell < window.cells(); ++cell) {
    const auto found = table_of_.find(window.block(cell));
    if (found != table_of_.end()) slots[cell] = found->second;
  }
  slots_.send(std::move(slots));
}

int SeenPoints::table(const BlockKey& block) {
  const auto [found, is_new] = table_of_.emplace(block, static_cast<int>(full_bricks_.size()));
  if (is_new) {
    full_bricks_.push_back(0);
    tables_.resize(tables_.size() + bricks_of_block(), SEEN_BRICK_EMPTY);
  }
  return found->second;
}

void SeenPoints::set_entry(int table, int brick, cl_int value) {
  const std::size_t place = at(table, brick);
  tables_[place] = value;
  changed_entries_.push_back({{static_cast<cl_int>(place), value}});
}

cl_int SeenPoints::add_brick(int table, int brick) {
  cl_int number = static_cast<cl_int>(used_);
  if (free_.empty()) {
    ++used_;
  } else {
    number = free_.back();
    free_.pop_back();
  }
  set_entry(table, brick, number);
  return number;
}

void SeenPoints::set_full(int table, int brick) {
  const cl_int before = entry(table, brick);
  if (before == SEEN_BRICK_FULL) return;
  if (before != SEEN_BRICK_EMPTY) free_.push_back(before);
  set_entry(table, brick, SEEN_BRICK_FULL);
  ++full_bricks_[table];
}

void SeenPoints::send_entries(const char* stage) {
  if (tables_.size() > sent_tables_) {
    tables_on_device_.grow(tables_.size(), sent_tables_);
    tables_on_device_.write(std::vector<cl_int>(tables_.begin() + sent_tables_, tables_.end()), sent_tables_);
    sent_tables_ = tables_.size();
  }
  if (changed_entries_.empty()) return;
  bricks_.grow(SEEN_WORDS * used_, bricks_.size());
  const auto count = static_cast<cl_int>(changed_entries_.size());
  entries_.send(std::move(changed_entries_));
  changed_entries_.clear();
  commands_.run(stage, "set_seen_bricks", SEEN_WORDS * static_cast<std::size_t>(count), kGroup, entries_(), count, tables_on_device_(),
                bricks_());
}

std::size_t SeenPoints::bytes() const {
  constexpr std::size_t kBlock = sizeof(BlockKey) + 4 * sizeof(void*);  // in the hash table
  return SEEN_WORDS * sizeof(cl_ulong) * used_ + 2 * sizeof(cl_int) * tables_.size() + table_of_.size() * (kBlock + sizeof(int));
}

}  // namespace frontier_surfels
