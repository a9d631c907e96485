/// The copy of the map compared with a plain std::map, and changes that have to wait.
#include <gtest/gtest.h>

#include <map>

#include "mapper_input.hpp"
#include "ros/output/map_publisher.hpp"
#include "ros/output/surfel_mirror.hpp"
#include "ros/surfel_input.hpp"

namespace frontier_surfels {
namespace {

constexpr std::uint32_t kIds = 3000;

template <typename Wanted>
std::vector<Surfel> those(const std::vector<Surfel>& surfels, Wanted wanted) {
  std::vector<Surfel> picked;
  std::copy_if(surfels.begin(), surfels.end(), std::back_inserter(picked), wanted);
  return picked;
}

void expect_equal(const SurfelMirror& mirror, const Follower& truth) {
  const auto all = truth.surfels();
  const auto is_occupied = [](const Surfel& s) { return s.label == Label::kOccupied; };
  EXPECT_EQ(mirror.sequence(), truth.sequence());
  EXPECT_EQ(mirror.size(), all.size());
  EXPECT_EQ(mirror.occupied(), those(all, is_occupied).size());
  EXPECT_TRUE(same(mirror.surfels(), all));
  EXPECT_TRUE(same(mirror.surfels(Label::kOccupied), those(all, is_occupied)));
  EXPECT_TRUE(same(mirror.surfels(Label::kFrontier), those(all, [&](const Surfel& s) { return !is_occupied(s); })));
  const Eigen::AlignedBox3f box(Eigen::Vector3f(-0.5F, -1, 0), Eigen::Vector3f(1, 0.3F, 2));
  EXPECT_TRUE(same(mirror.surfels(box), those(all, [&](const Surfel& s) { return box.contains(s.position); })));
  EXPECT_EQ(mirror.surfels(Eigen::AlignedBox3f()).size(), 0U);
}

/// The box, computed slowly: around all surfels that are updated, and all that were there before and are updated or removed.
Eigen::AlignedBox3f box_around(const std::vector<Surfel>& before, const Changes& changes) {
  Eigen::AlignedBox3f box;
  for (const Surfel& surfel : changes.updated) box.extend(surfel.position);
  for (const Surfel& surfel : before) {
    const bool updated =
        std::any_of(changes.updated.begin(), changes.updated.end(), [&](const Surfel& other) { return other.id == surfel.id; });
    if (updated || std::count(changes.removed.begin(), changes.removed.end(), surfel.id) > 0) box.extend(surfel.position);
  }
  return box;
}

TEST(SurfelMirror, FollowsRandomChanges) {
  Rng rng(1);
  SurfelMirror mirror;
  Follower truth;
  std::map<std::uint32_t, Surfel> visited;
  const auto visit = [&](const Surfel& surfel, bool comes) {
    if (comes) {
      EXPECT_TRUE(visited.emplace(surfel.id, surfel).second) << "it came twice";
    } else {
      ASSERT_EQ(visited.count(surfel.id), 1U);
      EXPECT_TRUE(same(visited[surfel.id], surfel)) << "the surfel that went is not the one that came";
      visited.erase(surfel.id);
    }
  };
  for (int n = 0; n < 100; ++n) {
    const Changes changes = random_changes(rng, mirror.sequence(), kIds, n % 10 == 9 ? 0 : 200);
    const Eigen::AlignedBox3f expected = box_around(truth.surfels(), changes), box = mirror.apply(changes, mirror.sequence(), visit);
    truth.apply(changes);
    expect_equal(mirror, truth);
    EXPECT_EQ(box.min(), expected.min());
    EXPECT_EQ(box.max(), expected.max());
    EXPECT_EQ(box.isEmpty(), n % 10 == 9);
    EXPECT_EQ(visited.size(), mirror.size());
  }
}

TEST(SurfelMirror, IsReplacedByAWholeMap) {
  Rng rng(2);
  SurfelMirror mirror;
  const auto old = random_surfels(rng, 500, 1);
  mirror.apply({7, old, {}}, 0);
  std::size_t went = 0, came = 0;
  Changes whole = random_changes(rng, 10, kIds, 400);
  whole.removed = {0, 1, 2, 0xffffffff};  // ids without a surfel
  whole.updated.erase(whole.updated.begin(), whole.updated.begin() + 3);
  Follower truth;
  truth.apply(whole);
  const Eigen::AlignedBox3f box = mirror.apply(whole, 0, [&](const Surfel&, bool comes) { ++(comes ? came : went); });
  expect_equal(mirror, truth);
  EXPECT_EQ(went, old.size());
  EXPECT_EQ(came, whole.updated.size());
  for (const Surfel& surfel : old) EXPECT_TRUE(box.contains(surfel.position));
  for (const Surfel& surfel : whole.updated) EXPECT_TRUE(box.contains(surfel.position));
}

TEST(SurfelMirror, RefusesAGap) {
  Rng rng(3);
  SurfelMirror mirror;
  Follower truth;
  const Changes first{7, random_surfels(rng, 100), {}};
  mirror.apply(first, 0);
  truth.apply(first);
  for (const std::uint64_t since : {6, 8}) EXPECT_THROW(mirror.apply(random_changes(rng, since, kIds, 50), since), Error);
  expect_equal(mirror, truth);
}

/// Ids are slots of the mapper's, of which most may be empty: they say nothing of how many surfels there are.
TEST(SurfelMirror, TakesIdsAboveTheNumberOfSurfelsInACloud) {
  Rng rng(8);
  SurfelMirror mirror;
  Follower truth;
  const auto apply = [&](const Changes& changes) {
    mirror.apply(changes, mirror.sequence());
    truth.apply(changes);
    expect_equal(mirror, truth);
  };
  apply({1, {random_surfel(rng, 3), random_surfel(rng, kMostSurfels), random_surfel(rng, 0xffffffff)}, {}});
  apply({2, {random_surfel(rng, kMostSurfels), random_surfel(rng, 0x80000000)}, {3, 4, 0xfffffffe}});
  apply({3, {}, {0xffffffff, 0x80000000}});
}

TEST(MergedChanges, EqualTheTwoOneByOne) {
  Rng rng(4);
  for (int n = 0; n < 50; ++n) {
    Follower singly, merged;
    const Changes start{1, random_surfels(rng, kIds / 2), {}};
    singly.apply(start);
    merged.apply(start);
    Changes earlier = random_changes(rng, 1, kIds, 800), later = random_changes(rng, earlier.sequence, kIds, 800);
    singly.apply(earlier);
    singly.apply(later);
    if (n % 2 == 1) {  // changes may be in any order
      std::shuffle(earlier.updated.begin(), earlier.updated.end(), rng);
      std::shuffle(later.removed.begin(), later.removed.end(), rng);
    }
    const Changes both = merge(earlier, later);
    merged.apply(both);
    EXPECT_EQ(both.sequence, later.sequence);
    EXPECT_TRUE(same(merged.surfels(), singly.surfels()));

    std::set<std::uint32_t> removed(both.removed.begin(), both.removed.end()), updated;
    for (const Surfel& surfel : both.updated) EXPECT_TRUE(updated.insert(surfel.id).second) << surfel.id << " is updated twice";
    EXPECT_EQ(removed.size(), both.removed.size()) << "an id is removed twice";
    for (const Changes* one : {&earlier, &later})
      for (const std::uint32_t id : one->removed) EXPECT_EQ(removed.count(id), 1U) << "nobody is told that " << id << " was removed";
  }
}

TEST(MergedChanges, TellOfAnIdThatWasGivenAgain) {
  Rng rng(5);
  const Surfel a = random_surfel(rng, 1), b = random_surfel(rng, 1);
  EXPECT_EQ(merge({2, {}, {1}}, {3, {a}, {}}).removed, std::vector<std::uint32_t>{1});
  EXPECT_TRUE(same(merge({2, {}, {1}}, {3, {a}, {}}).updated, {a}));
  EXPECT_TRUE(same(merge({2, {a}, {}}, {3, {b}, {}}).updated, {b}));
  EXPECT_TRUE(merge({2, {a}, {}}, {3, {}, {1}}).updated.empty());
  EXPECT_EQ(merge({2, {a}, {}}, {3, {}, {1}}).removed, std::vector<std::uint32_t>{1});
}

/// Changes go through a queue that is emptied seldom. What comes out is in order, and gives the map.
TEST(PushedChanges, GiveTheMapHoweverLongTheyWait) {
  constexpr std::size_t kMost = 4;
  Rng rng(6);
  for (int run = 0; run < 20; ++run) {
    SurfelMirror mirror;
    Follower truth;
    std::deque<PushedChanges> queue;
    std::uint64_t sequence = 0;
    for (int n = 0; n < 60; ++n) {
      const Changes changes = random_changes(rng, sequence, kIds, static_cast<int>(rng() % 300));
      truth.apply(changes);
      MapState state;
      state.stamp = ros::Time(static_cast<double>(changes.sequence));
      enqueue(queue, {changes, sequence, state}, kMost);
      sequence = changes.sequence;
      ASSERT_LE(queue.size(), kMost);
      EXPECT_EQ(queue.back().state.stamp, ros::Time(static_cast<double>(sequence)));
      if (rng() % 30 != 0 && n != 59) continue;
      for (const PushedChanges& pushed : queue) {
        EXPECT_EQ(pushed.state.stamp, ros::Time(static_cast<double>(pushed.changes.sequence)));
        mirror.apply(pushed.changes, pushed.since);
      }
      queue.clear();
      expect_equal(mirror, truth);
    }
  }
}

TEST(PushedChanges, NeedNothingBeforeAWholeMap) {
  Rng rng(7);
  std::deque<PushedChanges> queue;
  for (std::uint64_t n = 1; n < 4; ++n) enqueue(queue, {random_changes(rng, n, kIds, 10), n, {}}, 8);
  const Changes whole{20, random_surfels(rng, 50), {}};
  enqueue(queue, {whole, 0, {}}, 8);
  ASSERT_EQ(queue.size(), 1U);
  EXPECT_EQ(queue.front().since, 0U);
  EXPECT_TRUE(same(queue.front().changes.updated, whole.updated));
}

}  // namespace
}  // namespace frontier_surfels
