/// What has been seen, filled in from surfels alone: compared with a slow search over all points, for any number of threads, and when
/// memory is missing.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <memory>
#include <new>
#include <queue>
#include <random>
#include <unordered_map>
#include <unordered_set>

#include "frontier_surfels/mapper.hpp"
#include "map/seen_fill.hpp"
#include "stages/seen_bits.hpp"
#include "stages/test_device.hpp"

namespace {

// What this program allocates with `new` between watch() and stop().
constexpr std::size_t kLarge = 16384;  // [byte]: no thread of an OpenCL driver allocates as much at once
std::atomic<unsigned> watched{0}, watches{0};
std::atomic<long> allocations{0}, failing{0}, threads{0};
thread_local unsigned noted = 0;  // the watch in which this thread has allocated something large

/// @param fail  number of the allocation that fails, from 0; -1: none
void watch(long fail) {
  allocations = threads = 0;
  failing = fail;
  watched = ++watches;
}
void stop() { watched = 0; }

}  // namespace

// Not inlined: GCC would take malloc() and free() in a caller for a pair that does not fit.
[[gnu::noinline]] void* operator new(std::size_t size) {
  if (const unsigned now = watched; now != 0) {
    if (allocations++ == failing) throw std::bad_alloc();
    if (size >= kLarge && noted != now) ++threads;
    if (size >= kLarge) noted = now;
  }
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace frontier_surfels {
namespace {

constexpr double kBlock = 0.5;  // [m]
constexpr int kShift = 1;
constexpr double kSpacing = kBlock / (SEEN_BRICK << kShift);  // [m]

constexpr double kRadius = 0.15;  // of a ball [m]

Eigen::Vector3d center(int ball) { return {0.2 * ball, 0.1 + 0.13 * ball, 0.07 * ball}; }

/// Balls of known, or of unknown, space around points on a line, with surfels on the parts of their surfaces that no other ball has.
std::vector<Surfel> balls(int count, unsigned seed, bool known = true) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Surfel> surfels;
  for (int ball = 0; ball < count; ++ball)
    for (int n = 0; n < 2500; ++n) {
      const Eigen::Vector3d out = Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
      const Eigen::Vector3d p = center(ball) + kRadius * out;
      bool inside = false;
      for (int other = 0; other < count; ++other) inside |= (p - center(other)).norm() < 0.99 * kRadius;
      if (inside) continue;
      Surfel surfel;
      surfel.position = p.cast<float>();
      surfel.normal = (known ? -out : out).cast<float>();
      surfel.radius = static_cast<float>(0.35 * kSpacing);
      surfels.push_back(surfel);
    }
  return surfels;
}

/// The labels of the nearest labelled points: by the lengths of the shortest ways to all points. Where ways of the same length come from
/// both sides, either label is right.
class SlowFill {
 public:
  enum Labels : int { kNone = 0, kIsSeen = 1, kIsUnseen = 2 };

  explicit SlowFill(const std::vector<Surfel>& surfels) {
    for (const Surfel& surfel : surfels) {
      const Eigen::Array3d p = surfel.position.cast<double>().array(), reach = Eigen::Array3d::Constant(2 * kScale);
      const Eigen::Array3i first = brick_of(p - reach), last = brick_of(p + reach);
      for (int z = first.z(); z <= last.z(); ++z)
        for (int y = first.y(); y <= last.y(); ++y)
          for (int x = first.x(); x <= last.x(); ++x) near_[{x, y, z}].push_back(&surfel);
    }
    low_ = high_ = near_.begin()->first;
    for (const auto& [brick, surfels_there] : near_) {
      low_ = {std::min(low_.x, brick.x), std::min(low_.y, brick.y), std::min(low_.z, brick.z)};
      high_ = {std::max(high_.x, brick.x), std::max(high_.y, brick.y), std::max(high_.z, brick.z)};
    }
    for (const auto& [brick, surfels_there] : near_) label(brick, surfels_there);
    search();
  }

  /// Labels that are right for a point, as bits.
  int labels(const BlockKey& point) const {
    const auto found = nodes_.find(node_of(point));
    return found == nodes_.end() ? kNone : found->second.labels;
  }
  const BlockKey& low() const { return low_; }
  const BlockKey& high() const { return high_; }  ///< the last brick

 private:
  struct Node {
    int distance, labels;
    bool fixed = false;
  };
  static constexpr double kScale = 0.8 * kSpacing;

  static Eigen::Array3i brick_of(const Eigen::Array3d& p) { return (p / (SEEN_BRICK * kSpacing)).floor().cast<int>(); }
  static int down(int a) { return a >= 0 ? a / SEEN_BRICK : -((SEEN_BRICK - 1 - a) / SEEN_BRICK); }
  static BlockKey brick_of(const BlockKey& point) { return {down(point.x), down(point.y), down(point.z)}; }

  /// Of a point: the point, or the first point of its brick if no surfel reaches into the brick.
  BlockKey node_of(const BlockKey& point) const {
    const BlockKey brick = brick_of(point);
    if (near_.count(brick) > 0) return point;
    return {brick.x * SEEN_BRICK, brick.y * SEEN_BRICK, brick.z * SEEN_BRICK};
  }

  void label(const BlockKey& brick, const std::vector<const Surfel*>& surfels) {
    for (int n = 0; n < SEEN_BRICK * SEEN_BRICK * SEEN_BRICK; ++n) {
      const BlockKey point = {brick.x * SEEN_BRICK + n % SEEN_BRICK, brick.y * SEEN_BRICK + n / SEEN_BRICK % SEEN_BRICK,
                              brick.z * SEEN_BRICK + n / SEEN_BRICK / SEEN_BRICK};
      double side = 0, weights = 0;
      for (const Surfel* surfel : surfels) {
        const Eigen::Vector3d d = (Eigen::Array3d(point.x, point.y, point.z) + 0.5).matrix() * kSpacing - surfel->position.cast<double>();
        const double weight = std::pow(std::max(0.0, 1 - d.squaredNorm() / (4 * kScale * kScale)), 4);
        weights += weight;
        side += weight * (surfel->normal.cast<double>().dot(d) - surfel->radius / 4);
      }
      const bool unseen = weights > 0.5 && side < -0.2 * kSpacing * weights;
      if (side > 0 || unseen) nodes_[point] = {surfels.size() >= 16 ? 0 : 1 << 20, side > 0 ? kIsSeen : kIsUnseen, true};
    }
  }

  void search() {
    using Entry = std::pair<int, BlockKey>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    for (const auto& [point, node] : nodes_)
      if (node.distance == 0) queue.push({0, point});
    std::unordered_set<BlockKey> done;
    while (!queue.empty()) {
      const auto [distance, point] = queue.top();
      queue.pop();
      if (!done.insert(point).second) continue;
      const bool whole = near_.count(brick_of(point)) == 0;
      for_each_beside(point, whole, [&](const BlockKey& beside) {
        const BlockKey brick = brick_of(beside), target = node_of(beside);
        if (!inside(brick)) return;
        const bool to_whole = near_.count(brick) == 0;
        const int step = (whole ? SEEN_BRICK / 2 : 1) + (to_whole ? SEEN_BRICK / 2 : 0);
        const auto [found, is_new] = nodes_.emplace(target, Node{distance + step, kNone});
        Node& node = found->second;
        if (node.fixed || node.distance < distance + step) return;
        if (node.distance > distance + step) node = {distance + step, kNone};
        node.labels |= nodes_.at(point).labels;
        queue.push({node.distance, target});
      });
    }
  }

  bool inside(const BlockKey& b) const {
    return b.x >= low_.x && b.y >= low_.y && b.z >= low_.z && b.x <= high_.x && b.y <= high_.y && b.z <= high_.z;
  }

  /// The six points beside a point, or all those beside a brick.
  template <typename Visit>
  static void for_each_beside(const BlockKey& point, bool whole, Visit visit) {
    const int size = whole ? SEEN_BRICK : 1;
    for (int a = 0; a < size; ++a)
      for (int b = 0; b < size; ++b)
        for (const int c : {-1, size}) {
          visit({point.x + c, point.y + a, point.z + b});
          visit({point.x + a, point.y + c, point.z + b});
          visit({point.x + a, point.y + b, point.z + c});
        }
  }

  std::unordered_map<BlockKey, std::vector<const Surfel*>> near_;  ///< surfels that reach into each brick
  std::unordered_map<BlockKey, Node> nodes_;
  BlockKey low_, high_;
};

TEST(SeenFill, AllPointsGetTheLabelOfTheNearestOne) {
  for (const std::vector<Surfel>& surfels : {balls(1, 1), balls(5, 2), balls(5, 3, false)}) {
    const reference::SeenBits bits(fill_seen(surfels, kBlock, kShift, 0));
    const SlowFill slow(surfels);
    std::size_t seen = 0, unseen = 0, either = 0;
    for (int z = slow.low().z * SEEN_BRICK; z < (slow.high().z + 1) * SEEN_BRICK; ++z)
      for (int y = slow.low().y * SEEN_BRICK; y < (slow.high().y + 1) * SEEN_BRICK; ++y)
        for (int x = slow.low().x * SEEN_BRICK; x < (slow.high().x + 1) * SEEN_BRICK; ++x) {
          const int labels = slow.labels({x, y, z});
          ++(labels == SlowFill::kIsSeen ? seen : labels == SlowFill::kIsUnseen ? unseen : either);
          if (labels == SlowFill::kIsSeen || labels == SlowFill::kIsUnseen) {
            ASSERT_EQ(bits.seen(x, y, z), labels == SlowFill::kIsSeen) << "point " << x << ", " << y << ", " << z;
          }
        }
    EXPECT_GT(seen, 3000u);
    EXPECT_GT(unseen, 3000u);
    EXPECT_LT(either, (seen + unseen) / 10);
  }
}

testing::AssertionResult same(const SeenSpace& a, const SeenSpace& b) {
  if (a.blocks.size() != b.blocks.size()) return testing::AssertionFailure() << a.blocks.size() << " blocks against " << b.blocks.size();
  for (std::size_t n = 0; n < a.blocks.size(); ++n)
    if (a.blocks[n].block != b.blocks[n].block || a.blocks[n].bytes != b.blocks[n].bytes)
      return testing::AssertionFailure() << "block " << n << " differs";
  return testing::AssertionSuccess();
}

TEST(SeenFill, TheSameForAnyNumberOfThreads) {
  const std::vector<Surfel> surfels = balls(6, 3);
  const SeenSpace alone = fill_seen(surfels, kBlock, kShift, 1);
  EXPECT_FALSE(alone.blocks.empty());
  for (const int count : {0, 2, 3, 4096}) EXPECT_TRUE(same(fill_seen(surfels, kBlock, kShift, count), alone)) << count << " threads";
}

/// A mapper whose device has done everything, so that the driver allocates nothing any more for kernels that it compiles.
std::unique_ptr<Mapper> mapper_of(const std::vector<Surfel>& surfels, const Config& config) {
  auto mapper = std::make_unique<Mapper>(config);
  mapper->load(surfels);
  mapper->surfels();
  return mapper;
}

TEST(SeenFill, LoadUsesAsManyThreadsAsItIsTold) {
  if (!can_be_divided(choose_device({}))) GTEST_SKIP() << "The device cannot be divided.";
  const SavedMap map = {balls(6, 3), {}, {}};
  Config config;
  config.threads = 1;
  const auto mapper = mapper_of(map.surfels, config);
  watch(-1);
  mapper->load(map);
  stop();
  EXPECT_EQ(threads, 1);
}

/// Whichever thread notices it.
TEST(SeenFill, MissingMemoryIsToldAndTheMapStays) {
  const SavedMap map = {balls(2, 4), {}, {}};
  const Config config;
  watch(-1);
  seen_of(map.surfels, map.seen, kBlock, config.threads);
  stop();
  const long count = allocations;
  const auto mapper = mapper_of(balls(1, 5), config);
  const std::size_t before = mapper->size();
  for (long fail = 0; fail < count; fail += 1 + fail / 8) {
    SCOPED_TRACE("allocation " + std::to_string(fail) + " of " + std::to_string(count));
    std::string said;
    watch(fail);
    try {
      mapper->load(map);
    } catch (const Error& error) {
      said = error.what();
    }
    stop();
    EXPECT_NE(said.find("there is not enough memory"), std::string::npos) << said;
    ASSERT_EQ(mapper->size(), before);
  }
  mapper->load(map);
  EXPECT_EQ(mapper->size(), map.surfels.size());
}

}  // namespace
}  // namespace frontier_surfels
