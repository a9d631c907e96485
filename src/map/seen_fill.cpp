#include "map/seen_fill.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <new>
#include <system_error>
#include <tuple>
#include <utility>

#include "common/shared.h"
#include "config/threads.hpp"
#include "map/seen_block.hpp"
#include "map/seen_labels.hpp"
#include "map/seen_points.hpp"

namespace frontier_surfels {
namespace {

// The search starts where there are many surfels, and goes no further than this: otherwise surfels that no mapper has made, far from each
// other or alone, would fill all the world.
constexpr std::uint32_t kDense = 16;          // surfels that reach into a brick
constexpr std::size_t kFarthest = 8;          // [block]
constexpr std::size_t kMostBricks = 1000000;  // and one for each surfel; a room has 20 surfels a brick

constexpr int kWhole = kBrickPoints;  // stands for all points of a brick without surfels
constexpr int kOutside = -1, kNotAsked = -2;

/// Gives the label of the nearest labelled point to all others, in steps of 1 between neighbouring points. A brick without surfels gets one
/// label as a whole, in steps of half a brick. Of labels that come at the same time, the first one in the queue stays.
class Search {
 public:
  Search(LabelledBricks&& near, std::size_t most_bricks, std::size_t farthest)
      : bricks_(std::move(near.bricks)), labels_(std::move(near.labels)), most_bricks_(most_bricks), farthest_(farthest) {
    find_bounds();
    beside_.resize(labels_.size(), {kNotAsked, kNotAsked, kNotAsked, kNotAsked, kNotAsked, kNotAsked});
    for (std::uint32_t brick = 0; brick < labels_.size(); ++brick)
      if (near.count[brick] >= kDense) begin_at(brick);
  }

  void run() {
    while (queued_seen_ > 0 && bricks_.size() < most_bricks_ && distance_ < farthest_) search_next();
  }

  const Bricks& bricks() const { return bricks_; }
  int seen_points(std::size_t brick) const {
    return has_points(brick) ? labels_[brick].count_seen() : whole(brick).label == kSeen ? kBrickPoints : 0;
  }
  bool is_seen(std::size_t brick, int point) const { return labels_[brick].get(point) == kSeen; }  ///< of a brick with surfels

 private:
  struct Node {
    std::uint32_t brick;
    std::uint16_t point;  ///< or kWhole
    std::uint8_t label;
  };
  /// A brick without surfels.
  struct Whole {
    std::uint8_t label = kOpen;
    std::size_t queued = std::numeric_limits<std::size_t>::max();  ///< distance at which it gets a label
  };

  bool has_points(std::size_t brick) const { return brick < labels_.size(); }
  const Whole& whole(std::size_t brick) const { return wholes_[brick - labels_.size()]; }
  Whole& whole(std::size_t brick) { return wholes_[brick - labels_.size()]; }
  void find_bounds();
  void begin_at(std::uint32_t brick);
  void search_next();
  bool give_label(const Node& node);
  void visit_neighbours(const Node& node);
  void visit_neighbours_of_brick(const Node& node);
  int neighbour(std::uint32_t brick, int axis, int side);
  void push(const Node& node, std::size_t after);
  void reach_point(std::uint32_t brick, int point, std::uint8_t label, std::size_t after);
  void reach_whole(std::uint32_t brick, std::uint8_t label, std::size_t after);

  Bricks bricks_;  ///< first those with surfels
  std::vector<PointLabels> labels_;
  std::vector<std::array<int, 6>> beside_;  ///< neighbours of the bricks with surfels, once they have been asked for
  std::vector<Whole> wholes_;
  const std::size_t most_bricks_, farthest_;  ///< farthest_ [spacing]
  BlockKey low_, high_;                       ///< bricks that the search stays between
  static constexpr std::size_t kBuckets = SEEN_BRICK + 1;
  std::array<std::deque<Node>, kBuckets> queue_;  ///< by distance, modulo kBuckets [spacing]
  std::size_t distance_ = 0, queued_seen_ = 0;
};

void Search::find_bounds() {
  low_ = high_ = bricks_.key(0);
  for (const BlockKey& key : bricks_.keys()) {
    low_ = {std::min(low_.x, key.x), std::min(low_.y, key.y), std::min(low_.z, key.z)};
    high_ = {std::max(high_.x, key.x), std::max(high_.y, key.y), std::max(high_.z, key.z)};
  }
}

void Search::begin_at(std::uint32_t brick) {
  for (int point = 0; point < kBrickPoints; ++point) {
    const std::uint8_t label = labels_[brick].get(point);
    if (label == kSeen || label == kUnseen) visit_neighbours({brick, static_cast<std::uint16_t>(point), label});
  }
}

void Search::search_next() {
  std::deque<Node>& now = queue_[distance_ % kBuckets];
  for (; !now.empty(); now.pop_front()) {
    const Node& node = now.front();
    if (node.label == kSeen) --queued_seen_;
    if (!give_label(node)) continue;
    if (node.point == kWhole)
      visit_neighbours_of_brick(node);
    else
      visit_neighbours(node);
  }
  ++distance_;
}

/// @return whether it had none
bool Search::give_label(const Node& node) {
  if (node.point == kWhole) {
    if (whole(node.brick).label != kOpen) return false;
    whole(node.brick).label = node.label;
    return true;
  }
  const std::uint8_t before = labels_[node.brick].get(node.point);
  if (before == kSeen || before == kUnseen) return false;
  labels_[node.brick].set(node.point, node.label);
  return true;
}

/// The brick beside a brick, or kOutside.
int Search::neighbour(std::uint32_t brick, int axis, int side) {
  int* known = has_points(brick) ? &beside_[brick][2 * axis + (side > 0 ? 1 : 0)] : nullptr;
  if (known != nullptr && *known != kNotAsked) return *known;
  BlockKey key = bricks_.key(brick);
  (axis == 0 ? key.x : axis == 1 ? key.y : key.z) += side;
  const bool inside = key.x >= low_.x && key.y >= low_.y && key.z >= low_.z && key.x <= high_.x && key.y <= high_.y && key.z <= high_.z;
  const int found = inside ? static_cast<int>(bricks_.add(key)) : kOutside;
  wholes_.resize(bricks_.size() - labels_.size());
  if (known != nullptr) *known = found;
  return found;
}

void Search::push(const Node& node, std::size_t after) {
  queue_[(distance_ + after) % kBuckets].push_back(node);
  if (node.label == kSeen) ++queued_seen_;
}

/// What is one step away is queued once: whatever comes later comes too late.
void Search::reach_point(std::uint32_t brick, int point, std::uint8_t label, std::size_t after) {
  if (labels_[brick].get(point) != kOpen) return;
  if (after == 1) labels_[brick].set(point, kQueued);
  push({brick, static_cast<std::uint16_t>(point), label}, after);
}

void Search::reach_whole(std::uint32_t brick, std::uint8_t label, std::size_t after) {
  const std::size_t at = distance_ + SEEN_BRICK / 2 + after;
  if (whole(brick).label != kOpen || at >= whole(brick).queued) return;
  whole(brick).queued = at;
  push({brick, kWhole, label}, SEEN_BRICK / 2 + after);
}

void Search::visit_neighbours(const Node& node) {
  constexpr int kLast = SEEN_BRICK - 1;
  for (int axis = 0, stride = 1; axis < 3; ++axis, stride *= SEEN_BRICK)
    for (const int side : {-1, 1}) {
      if (node.point / stride % SEEN_BRICK != (side < 0 ? 0 : kLast)) {
        reach_point(node.brick, node.point + side * stride, node.label, 1);
        continue;
      }
      const int beside = neighbour(node.brick, axis, side);
      if (beside == kOutside) continue;
      if (has_points(beside))
        reach_point(beside, node.point - side * kLast * stride, node.label, 1);
      else
        reach_whole(beside, node.label, 1);
    }
}

void Search::visit_neighbours_of_brick(const Node& node) {
  constexpr int kHalf = SEEN_BRICK / 2, kStrides[] = {1, SEEN_BRICK, SEEN_BRICK * SEEN_BRICK};
  for (int axis = 0; axis < 3; ++axis)
    for (const int side : {-1, 1}) {
      const int beside = neighbour(node.brick, axis, side);
      if (beside == kOutside) continue;
      if (!has_points(beside)) {
        reach_whole(beside, node.label, kHalf);
        continue;
      }
      const int first = side < 0 ? (SEEN_BRICK - 1) * kStrides[axis] : 0, along = kStrides[axis == 0 ? 1 : 0],
                across = kStrides[axis == 2 ? 1 : 2];
      for (int n = 0; n < SEEN_BRICK * SEEN_BRICK; ++n)
        reach_point(beside, first + n % SEEN_BRICK * along + n / SEEN_BRICK * across, node.label, kHalf);
    }
}

/// A brick's block, and its place among the bricks of the block.
struct Place {
  BlockKey block;
  int place;
  std::uint32_t brick;
};

/// The bricks that have a seen point, block by block.
std::vector<Place> places(const Search& search, int shift) {
  const int sides = (1 << shift) - 1;
  std::vector<Place> places;
  for (std::uint32_t brick = 0; brick < search.bricks().size(); ++brick) {
    if (search.seen_points(brick) == 0) continue;
    const BlockKey& key = search.bricks().key(brick);
    const int place = ((key.z & sides) << shift | (key.y & sides)) << shift | (key.x & sides);
    places.push_back({{key.x >> shift, key.y >> shift, key.z >> shift}, place, brick});
  }
  std::sort(places.begin(), places.end(),
            [](const Place& a, const Place& b) { return std::tie(a.block, a.place) < std::tie(b.block, b.place); });
  return places;
}

SeenSpace result(const Search& search, double block_size, int shift) {
  SeenSpace seen = {block_size, SEEN_BRICK << shift, {}};
  const std::vector<Place> all = places(search, shift);
  for (auto next = all.begin(); next != all.end();) {
    const BlockKey block = next->block;
    SeenBlockBytes bytes;
    for (int place = 0; place < 1 << (3 * shift); ++place) {
      if (next == all.end() || next->block != block || next->place != place) {
        bytes.add_uniform(SEEN_NONE);
        continue;
      }
      const std::uint32_t brick = next++->brick;
      if (search.seen_points(brick) == kBrickPoints)
        bytes.add_uniform(SEEN_ALL);
      else
        bytes.add_points([&](int point) { return search.is_seen(brick, point); });
    }
    seen.blocks.push_back({{block.x, block.y, block.z}, bytes.take()});
  }
  return seen;
}

}  // namespace

SeenSpace fill_seen(const std::vector<Surfel>& surfels, double block_size, int shift, int threads) {
  if (surfels.empty()) return {block_size, SEEN_BRICK << shift, {}};
  const std::size_t points = std::size_t{SEEN_BRICK} << shift;  // along a block's edge
  Search search(label_near_surfels(surfels, block_size / static_cast<double>(points), threads_of_host(threads)),
                kMostBricks + surfels.size(), kFarthest * points);
  search.run();
  return result(search, block_size, shift);
}

int shift_for(const std::vector<Surfel>& surfels, double block_size) {
  std::vector<float> radii;
  for (const Surfel& surfel : surfels)
    if (surfel.radius > 0) radii.push_back(surfel.radius);
  if (radii.empty()) return 0;
  const auto small = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 100);  // a few may be smaller than a mapper makes them
  std::nth_element(radii.begin(), small, radii.end());
  const double voxel = *small * 2 / std::sqrt(3.0);
  return SeenPoints::shift_for_spacing(block_size, kSeenSpacing * voxel);
}

SeenSpace seen_of(const std::vector<Surfel>& surfels, const SeenSpace& saved, double block_size, int threads) {
  if (saved.points != 0 && saved.block_size == block_size) {
    SeenPoints::check(saved);
    return saved;
  }
  const auto cannot = [&](const char* reason) {
    return Error("What has been seen cannot be filled in for " + std::to_string(surfels.size()) + " surfels, because " + reason +
                 ": end other programs, or load a map that was saved with what has been seen.");
  };
  try {
    return fill_seen(surfels, block_size, shift_for(surfels, block_size), threads);
  } catch (const std::bad_alloc&) {
    throw cannot("there is not enough memory");
  } catch (const std::system_error&) {
    throw cannot("no thread can be started");
  }
}

}  // namespace frontier_surfels
