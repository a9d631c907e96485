/// The first step of filling in what has been seen (seen_fill.hpp): points near surfels get a label by the surfels' sides.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "common/shared.h"
#include "frontier_surfels/types.hpp"
#include "map/block_key.hpp"

namespace frontier_surfels {

constexpr int kBrickPoints = SEEN_BRICK * SEEN_BRICK * SEEN_BRICK;

enum : std::uint8_t { kOpen = 0, kSeen = 1, kUnseen = 2, kQueued = 3 };  // kQueued: open, and the search is about to give it a label

/// Labels of a brick's points, two bits each. Points are numbered (z SEEN_BRICK + y) SEEN_BRICK + x.
class PointLabels {
 public:
  std::uint8_t get(int point) const { return words_[point / kPerWord] >> (2 * (point % kPerWord)) & 3; }
  void set(int point, std::uint8_t label) {
    std::uint64_t& word = words_[point / kPerWord];
    const int bit = 2 * (point % kPerWord);
    word = (word & ~(std::uint64_t{3} << bit)) | std::uint64_t{label} << bit;
  }
  int count_seen() const;

 private:
  static constexpr int kPerWord = 32;
  std::array<std::uint64_t, kBrickPoints / kPerWord> words_ = {};
};

/// Bricks by their keys, which are counted in bricks from the world's origin. They are numbered in the order in which they came.
class Bricks {
 public:
  std::uint32_t add(const BlockKey& key) {
    const auto [found, is_new] = index_.emplace(key, static_cast<std::uint32_t>(keys_.size()));
    if (is_new) keys_.push_back(key);
    return found->second;
  }
  std::size_t size() const { return keys_.size(); }
  const BlockKey& key(std::size_t number) const { return keys_[number]; }
  const std::vector<BlockKey>& keys() const { return keys_; }

 private:
  std::vector<BlockKey> keys_;
  std::unordered_map<BlockKey, std::uint32_t> index_;
};

/// The bricks that surfels reach into.
struct LabelledBricks {
  Bricks bricks;
  std::vector<PointLabels> labels;   ///< of each brick: kSeen, kUnseen or kOpen
  std::vector<std::uint32_t> count;  ///< of the surfels that reach into each brick
};

/// @param spacing  distance of the points [m]
/// @param threads  how many to use, the calling one included. The labels do not depend on it
/// @throws std::bad_alloc, std::system_error  memory or threads are missing, also where one of the threads has noticed it
LabelledBricks label_near_surfels(const std::vector<Surfel>& surfels, double spacing, int threads);

}  // namespace frontier_surfels
