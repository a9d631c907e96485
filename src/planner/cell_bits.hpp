/// The cells of a cluster as bits, among which neighbours are found many at a time.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "map/block_key.hpp"

namespace frontier_surfels {

/// A box of at most 64 cells along each axis: a word for each row along z, with an empty row around them.
class CellBits {
 public:
  /// Can this be used for a box? @tparam Box  with corners low and high, both included
  template <typename Box>
  static bool fits(const Box& box) {
    return std::max({box.high.x - box.low.x, box.high.y - box.low.y, box.high.z - box.low.z}) < 64;
  }

  /// @param cells  pointers to cells with keys within the box; not none
  template <typename Cells, typename Box>
  CellBits(const Cells& cells, const Box& box)
      : stride_(box.high.y - box.low.y + 3), rows_(static_cast<std::size_t>(stride_) * (box.high.x - box.low.x + 3)) {
    const auto row_of = [&](const BlockKey& key) { return (key.x - box.low.x + 1) * stride_ + key.y - box.low.y + 1; };
    for (const auto* cell : cells) rows_[row_of(cell->key)].all |= std::uint64_t{1} << (cell->key.z - box.low.z);
    const BlockKey& first = cells.front()->key;
    rows_[row_of(first)].reached = std::uint64_t{1} << (first.z - box.low.z);
  }

  /// Can every cell be reached from the first one, from a cell to one of the 26 around it? Rows are gone through upwards and downwards in
  /// turn until nothing is reached any more. To be called once.
  bool are_connected() {
    const int first = stride_ + 1, last = static_cast<int>(rows_.size()) - stride_ - 2;
    for (bool more = true; more;) {
      more = false;
      for (int row = first; row <= last; ++row) more = reach(row) || more;
      if (!more) break;
      more = false;
      for (int row = last; row >= first; --row) more = reach(row) || more;
    }
    return std::all_of(rows_.begin(), rows_.end(), [](const Row& row) { return row.reached == row.all; });
  }

 private:
  struct Row {
    std::uint64_t all = 0, reached = 0;
  };

  /// Goes from the rows around this one into it, and along it. @return whether that has reached more
  bool reach(int at) {
    Row& row = rows_[at];
    if (row.reached == row.all) return false;
    std::uint64_t found = 0;
    for (const int x : {-stride_, 0, stride_}) found |= rows_[at + x - 1].reached | rows_[at + x].reached | rows_[at + x + 1].reached;
    for (std::uint64_t before = ~found; found != before;) {
      before = found;
      found |= (found << 1 | found >> 1) & row.all;
    }
    found &= row.all;
    const bool more = found != row.reached;
    row.reached = found;
    return more;
  }

  int stride_;  ///< rows from one x to the next
  std::vector<Row> rows_;
};

}  // namespace frontier_surfels
