#include "map/seen_labels.hpp"

#include <algorithm>
#include <atomic>
#include <deque>
#include <future>
#include <memory>
#include <utility>

namespace frontier_surfels {
namespace {

// Points behind surfels are unseen only if several surfels say so, and not by a hair: a surfel alone is more likely a wrong one, and a
// wrong unseen point makes all points around it unseen, too.
constexpr double kLeastWeight = 0.5;  // sum of the surfels' weights, which are 1 at most
constexpr double kLeastDepth = 0.2;   // mean depth behind the discs [spacing]

// The work is bounded: of more surfels in a brick every second one is asked, every third, and so on; and no surfel reaches further than a
// brick.
constexpr std::size_t kMostSurfels = 8192;
constexpr double kMostScale = SEEN_BRICK / 2;  // [spacing]

/// Sums over the surfels for each point of a brick.
struct Sums {
  std::array<double, kBrickPoints> sides, weights;
};

class Labelling {
 public:
  Labelling(const std::vector<Surfel>& surfels, double spacing) : surfels_(surfels), spacing_(spacing) {}

  LabelledBricks run(int threads) {
    find_bricks();
    label_bricks(threads);
    return std::move(result_);
  }

 private:
  /// Of a surfel's weights [m].
  double scale(const Surfel& surfel) const {
    const double least = 0.8 * spacing_;
    return surfel.radius > least ? std::min<double>(surfel.radius, kMostScale * spacing_) : least;
  }
  template <typename Visit>
  void for_each_brick(const Surfel& surfel, Visit visit) const;
  void find_bricks();
  void label_bricks(int threads);
  void add(const Surfel& surfel, const Eigen::Array3d& corner, Sums& sums) const;
  void label_points(std::size_t brick, Sums& sums);

  const std::vector<Surfel>& surfels_;
  const double spacing_;  ///< [m]
  LabelledBricks result_;
  std::vector<std::size_t> end_;         ///< of each brick's part of list_
  std::vector<std::uint32_t> of_brick_;  ///< surfels that reach into each brick, brick by brick
};

/// Calls visit(key) for the bricks that a surfel reaches into.
template <typename Visit>
void Labelling::for_each_brick(const Surfel& surfel, Visit visit) const {
  const double size = SEEN_BRICK * spacing_, reach = 2 * scale(surfel);
  const Eigen::Array3d p = surfel.position.cast<double>().array();
  const Eigen::Array3i first = ((p - reach) / size).floor().cast<int>(), last = ((p + reach) / size).floor().cast<int>();
  for (int z = first.z(); z <= last.z(); ++z)
    for (int y = first.y(); y <= last.y(); ++y)
      for (int x = first.x(); x <= last.x(); ++x) visit(BlockKey{x, y, z});
}

void Labelling::find_bricks() {
  std::deque<std::uint32_t> numbers;  // of the bricks of all surfels, one surfel after the other
  for (const Surfel& surfel : surfels_)
    for_each_brick(surfel, [&](const BlockKey& key) {
      numbers.push_back(result_.bricks.add(key));
      if (result_.count.size() < result_.bricks.size()) result_.count.push_back(0);
      ++result_.count[numbers.back()];
    });
  end_.assign(result_.count.size(), 0);
  for (std::size_t brick = 1; brick < end_.size(); ++brick) end_[brick] = end_[brick - 1] + result_.count[brick - 1];
  of_brick_.resize(numbers.size());
  for (std::uint32_t n = 0; n < surfels_.size(); ++n)
    for_each_brick(surfels_[n], [&](const BlockKey&) {
      of_brick_[end_[numbers.front()]++] = n;
      numbers.pop_front();
    });
}

void Labelling::label_bricks(int threads) {
  result_.labels.resize(result_.bricks.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    try {
      const auto sums = std::make_unique<Sums>();
      for (std::size_t brick = next++; brick < result_.labels.size(); brick = next++) label_points(brick, *sums);
    } catch (...) {
      next = result_.labels.size();
      throw;
    }
  };
  std::vector<std::future<void>> workers;
  for (int n = 1; n < threads; ++n) workers.push_back(std::async(std::launch::async, work));
  work();
  for (std::future<void>& worker : workers) worker.get();
}

/// Adds (1 - d^2 / (2 s)^2)^4 (h - r / 4) to each point: d is the distance to the surfel, s its scale, and h the height above its disc.
/// Surfels stand a quarter of their radius before the boundary.
/// @param corner  the brick's first point [spacing]
void Labelling::add(const Surfel& surfel, const Eigen::Array3d& corner, Sums& sums) const {
  const double reach = 2 * scale(surfel);
  const Eigen::Vector3d p = surfel.position.cast<double>(), normal = surfel.normal.cast<double>();
  const Eigen::Array3i first = ((p.array() - reach) / spacing_ - corner).ceil().max(0).cast<int>(),
                       last = ((p.array() + reach) / spacing_ - corner).floor().min(SEEN_BRICK - 1).cast<int>();
  for (int z = first.z(); z <= last.z(); ++z)
    for (int y = first.y(); y <= last.y(); ++y) {
      const double dz = (corner.z() + z) * spacing_ - p.z(), dy = (corner.y() + y) * spacing_ - p.y();
      const double square = dy * dy + dz * dz, height = normal.y() * dy + normal.z() * dz;
      const int row = (z * SEEN_BRICK + y) * SEEN_BRICK;
      for (int x = first.x(); x <= last.x(); ++x) {
        const double dx = (corner.x() + x) * spacing_ - p.x();
        const double share = std::max(0.0, 1 - (dx * dx + square) / (reach * reach));
        const double weight = share * share * share * share;
        sums.weights[row + x] += weight;
        sums.sides[row + x] += weight * (normal.x() * dx + height - surfel.radius / 4);
      }
    }
}

/// The label of a point is the sign of its sum.
void Labelling::label_points(std::size_t brick, Sums& sums) {
  sums.sides.fill(0);
  sums.weights.fill(0);
  const BlockKey& key = result_.bricks.key(brick);
  const Eigen::Array3d corner = Eigen::Array3d(key.x, key.y, key.z) * SEEN_BRICK + 0.5;
  const std::size_t count = result_.count[brick], stride = count / kMostSurfels + 1;
  for (std::size_t n = 0; n < count; n += stride) add(surfels_[of_brick_[end_[brick] - count + n]], corner, sums);
  for (int point = 0; point < kBrickPoints; ++point) {
    const double side = sums.sides[point], weight = sums.weights[point];
    const bool unseen = side < -kLeastDepth * spacing_ * weight && weight > kLeastWeight;
    if (side > 0 || unseen) result_.labels[brick].set(point, side > 0 ? kSeen : kUnseen);
  }
}

}  // namespace

int PointLabels::count_seen() const {
  int count = 0;
  for (const std::uint64_t word : words_) count += __builtin_popcountll(word & ~(word >> 1) & 0x5555555555555555);
  return count;
}

LabelledBricks label_near_surfels(const std::vector<Surfel>& surfels, double spacing, int threads) {
  return Labelling(surfels, spacing).run(threads);
}

}  // namespace frontier_surfels
