#include "map/seen_fill.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <thread>
#include <unordered_map>

#include "common/shared.h"
#include "map/block_key.hpp"
#include "map/seen_block.hpp"
#include "map/seen_points.hpp"

namespace frontier_surfels {
namespace {

constexpr int kPoints = SEEN_BRICK * SEEN_BRICK * SEEN_BRICK;  // of a brick
constexpr int kWhole = kPoints;                                // stands for all points of a brick without surfels

// Points behind surfels are unseen only if several surfels say so, and not by a hair: a surfel alone is more likely a wrong one, and a
// wrong unseen point makes all points around it unseen, too.
constexpr double kLeastWeight = 0.5;  // sum of the surfels' weights, which are 1 at most
constexpr double kLeastDepth = 0.2;   // mean depth behind the discs [spacing]

// The search starts where there are many surfels, and goes no further than this: otherwise surfels that no mapper has made, far from each
// other or alone, would fill all the world.
constexpr std::size_t kDense = 16;            // surfels that reach into a brick
constexpr double kFarthest = 8;               // [block]
constexpr std::size_t kMostBricks = 1000000;  // and one for each surfel; a room has 20 surfels a brick

// The work is bounded: of more surfels in a brick every second one is asked, every third, and so on; and no surfel reaches further than a
// brick.
constexpr std::size_t kMostSurfels = 8192;
constexpr double kMostScale = SEEN_BRICK / 2;  // [spacing]

enum : std::uint8_t { kOpen = 0, kSeen = 1, kUnseen = 2 };

/// Points are numbered (z SEEN_BRICK + y) SEEN_BRICK + x.
struct Brick {
  BlockKey key;                        ///< counted in bricks from the world's origin
  std::vector<std::uint32_t> surfels;  ///< that reach into it
  std::vector<std::uint8_t> labels;    ///< of its points, or of all together: [kPoints] or [1]
};

class Filling {
 public:
  Filling(const std::vector<Surfel>& surfels, double block_size, int shift)
      : surfels_(surfels), block_size_(block_size), shift_(shift), spacing_(block_size / (SEEN_BRICK << shift)) {}

  SeenSpace run() {
    find_bricks();
    label_near_surfels();
    begin_search();
    while (queued_seen_ > 0 && bricks_.size() < kMostBricks + surfels_.size() &&
           static_cast<double>(distance_) * spacing_ < kFarthest * block_size_)
      search_next();
    return result();
  }

 private:
  struct Node {
    std::uint32_t brick;
    std::int32_t point;  ///< or kWhole
    std::uint8_t label;
  };

  /// Of a surfel's weights [m].
  double scale(const Surfel& surfel) const {
    const double least = 0.8 * spacing_;
    return surfel.radius > least ? std::min<double>(surfel.radius, kMostScale * spacing_) : least;
  }
  void find_bricks();
  void label_near_surfels();
  void label_points(Brick& brick) const;
  void begin_search();
  void search_next();
  void reach(const BlockKey& key, int point, std::uint8_t label, std::size_t after);
  void visit_neighbours(const Node& node);
  int find(const BlockKey& key) const {
    const auto found = index_.find(key);
    return found == index_.end() ? -1 : static_cast<int>(found->second);
  }
  std::uint32_t add(const BlockKey& key) {
    const auto [found, is_new] = index_.emplace(key, static_cast<std::uint32_t>(bricks_.size()));
    if (is_new) bricks_.push_back({key, {}, {}});
    return found->second;
  }
  SeenSpace result() const;

  const std::vector<Surfel>& surfels_;
  const double block_size_;  ///< [m]
  const int shift_;
  const double spacing_;  ///< [m]
  std::vector<Brick> bricks_;
  std::unordered_map<BlockKey, std::uint32_t> index_;
  BlockKey low_, high_;  ///< bricks that the search stays between
  static constexpr std::size_t kBuckets = SEEN_BRICK + 1;
  std::vector<Node> queue_[kBuckets];  ///< by distance, modulo kBuckets [spacing]
  std::size_t distance_ = 0, queued_seen_ = 0;
};

void Filling::find_bricks() {
  const double size = SEEN_BRICK * spacing_;
  for (std::uint32_t n = 0; n < surfels_.size(); ++n) {
    const Eigen::Array3d p = surfels_[n].position.cast<double>().array();
    const double reach = 2 * scale(surfels_[n]);
    const Eigen::Array3d first = ((p - reach) / size).floor(), last = ((p + reach) / size).floor();
    for (int z = static_cast<int>(first.z()); z <= static_cast<int>(last.z()); ++z)
      for (int y = static_cast<int>(first.y()); y <= static_cast<int>(last.y()); ++y)
        for (int x = static_cast<int>(first.x()); x <= static_cast<int>(last.x()); ++x) bricks_[add({x, y, z})].surfels.push_back(n);
  }
  low_ = high_ = bricks_.front().key;
  for (const Brick& brick : bricks_) {
    low_ = {std::min(low_.x, brick.key.x), std::min(low_.y, brick.key.y), std::min(low_.z, brick.key.z)};
    high_ = {std::max(high_.x, brick.key.x), std::max(high_.y, brick.key.y), std::max(high_.z, brick.key.z)};
  }
}

void Filling::label_near_surfels() {
  const std::size_t threads = std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::thread> workers;
  for (std::size_t first = 0; first < threads; ++first)
    workers.emplace_back([this, first, threads] {
      for (std::size_t n = first; n < bricks_.size(); n += threads) label_points(bricks_[n]);
    });
  for (std::thread& worker : workers) worker.join();
}

/// The label of a point is the sign of the sum of (1 - d^2 / (2 s)^2)^4 (h - r / 4): d is the distance to a surfel, s its scale, and h the
/// height above its disc. Surfels stand a quarter of their radius before the boundary.
void Filling::label_points(Brick& brick) const {
  std::vector<double> sums(kPoints, 0.0), weights(kPoints, 0.0);
  const Eigen::Array3d corner = Eigen::Array3d(brick.key.x, brick.key.y, brick.key.z) * SEEN_BRICK + 0.5;  // the first point [spacing]
  const std::size_t stride = brick.surfels.size() / kMostSurfels + 1;
  for (std::size_t n = 0; n < brick.surfels.size(); n += stride) {
    const Surfel& surfel = surfels_[brick.surfels[n]];
    const double reach = 2 * scale(surfel);
    const Eigen::Vector3d p = surfel.position.cast<double>(), normal = surfel.normal.cast<double>();
    const Eigen::Array3i first = ((p.array() - reach) / spacing_ - corner).ceil().max(0).cast<int>(),
                         last = ((p.array() + reach) / spacing_ - corner).floor().min(SEEN_BRICK - 1).cast<int>();
    for (int z = first.z(); z <= last.z(); ++z)
      for (int y = first.y(); y <= last.y(); ++y)
        for (int x = first.x(); x <= last.x(); ++x) {
          const Eigen::Vector3d d = (corner + Eigen::Array3d(x, y, z)).matrix() * spacing_ - p;
          const double share = 1 - d.squaredNorm() / (reach * reach);
          if (share <= 0) continue;
          const int point = (z * SEEN_BRICK + y) * SEEN_BRICK + x;
          const double weight = share * share * share * share;
          weights[point] += weight;
          sums[point] += weight * (normal.dot(d) - surfel.radius / 4);
        }
  }
  brick.labels.resize(kPoints);
  for (int n = 0; n < kPoints; ++n) {
    const bool unseen = sums[n] < -kLeastDepth * spacing_ * weights[n] && weights[n] > kLeastWeight;
    brick.labels[n] = sums[n] > 0 ? kSeen : unseen ? kUnseen : kOpen;
  }
}

void Filling::begin_search() {
  const std::size_t near = bricks_.size();
  for (std::uint32_t n = 0; n < near; ++n) {
    if (bricks_[n].surfels.size() < kDense) continue;
    for (int point = 0; point < kPoints; ++point)
      if (bricks_[n].labels[point] != kOpen) visit_neighbours({n, point, bricks_[n].labels[point]});
  }
}

/// Gives a point, or a whole brick without surfels, a label if it has none.
void Filling::reach(const BlockKey& key, int point, std::uint8_t label, std::size_t after) {
  if (key.x < low_.x || key.y < low_.y || key.z < low_.z || key.x > high_.x || key.y > high_.y || key.z > high_.z) return;
  const std::uint32_t n = add(key);
  Brick& brick = bricks_[n];
  if (brick.labels.empty()) brick.labels.assign(1, kOpen);
  const bool whole = brick.labels.size() == 1;
  if (brick.labels[whole ? 0 : point] != kOpen) return;
  queue_[(distance_ + (whole ? SEEN_BRICK / 2 : 0) + after) % kBuckets].push_back({n, whole ? kWhole : point, label});
  if (label == kSeen) ++queued_seen_;
}

void Filling::visit_neighbours(const Node& node) {
  const BlockKey key = bricks_[node.brick].key;
  const int last = SEEN_BRICK - 1;
  const auto step = [&](int axis, int side) {
    BlockKey next = key;
    (axis == 0 ? next.x : axis == 1 ? next.y : next.z) += side;
    return next;
  };
  const int strides[] = {1, SEEN_BRICK, SEEN_BRICK * SEEN_BRICK};
  for (int axis = 0; axis < 3; ++axis)
    for (const int side : {-1, 1}) {
      const int stride = strides[axis];
      if (node.point != kWhole) {
        const int place = node.point / stride % SEEN_BRICK;
        const bool leaves = place == (side < 0 ? 0 : last);
        const int point = node.point + (leaves ? -side * last : side) * stride;
        if (!leaves && bricks_[node.brick].labels[point] != kOpen) continue;
        reach(leaves ? step(axis, side) : key, point, node.label, 1);
        continue;
      }
      const int beside = find(step(axis, side));
      if (beside < 0 || bricks_[beside].labels.size() <= 1) {
        reach(step(axis, side), 0, node.label, SEEN_BRICK / 2);
        continue;
      }
      const int along = strides[axis == 0 ? 1 : 0], across = strides[axis == 2 ? 1 : 2];
      for (int n = 0; n < SEEN_BRICK * SEEN_BRICK; ++n)
        reach(step(axis, side), (side < 0 ? last : 0) * stride + n % SEEN_BRICK * along + n / SEEN_BRICK * across, node.label,
              SEEN_BRICK / 2);
    }
}

void Filling::search_next() {
  std::vector<Node> now;
  now.swap(queue_[distance_ % kBuckets]);
  for (const Node& node : now) {
    if (node.label == kSeen) --queued_seen_;
    std::uint8_t& label = bricks_[node.brick].labels[node.point == kWhole ? 0 : node.point];
    if (label != kOpen) continue;
    label = node.label;
    visit_neighbours(node);
  }
  ++distance_;
}

SeenSpace Filling::result() const {
  const int sides = (1 << shift_) - 1;
  std::map<BlockKey, std::vector<const Brick*>> blocks;
  for (const Brick& brick : bricks_) {
    if (std::count(brick.labels.begin(), brick.labels.end(), kSeen) == 0) continue;
    auto& own = blocks[{brick.key.x >> shift_, brick.key.y >> shift_, brick.key.z >> shift_}];
    own.resize(std::size_t{1} << (3 * shift_), nullptr);
    own[((brick.key.z & sides) << shift_ | (brick.key.y & sides)) << shift_ | (brick.key.x & sides)] = &brick;
  }
  SeenSpace seen;
  seen.block_size = block_size_;
  seen.points = SEEN_BRICK << shift_;
  for (const auto& [key, bricks] : blocks) {
    SeenBlockBytes bytes;
    for (const Brick* brick : bricks) {
      if (brick == nullptr)
        bytes.add_uniform(SEEN_NONE);
      else if (std::all_of(brick->labels.begin(), brick->labels.end(), [](std::uint8_t label) { return label == kSeen; }))
        bytes.add_uniform(SEEN_ALL);
      else
        bytes.add_points([&](int point) { return brick->labels[point] == kSeen; });
    }
    seen.blocks.push_back({{key.x, key.y, key.z}, bytes.take()});
  }
  return seen;
}

}  // namespace

SeenSpace fill_seen(const std::vector<Surfel>& surfels, double block_size, int shift) {
  if (surfels.empty()) return {block_size, SEEN_BRICK << shift, {}};
  return Filling(surfels, block_size, shift).run();
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

SeenSpace seen_of(const SavedMap& map, double block_size) {
  if (map.seen.points == 0 || map.seen.block_size != block_size)
    return fill_seen(map.surfels, block_size, shift_for(map.surfels, block_size));
  SeenPoints::check(map.seen);
  return map.seen;
}

}  // namespace frontier_surfels
