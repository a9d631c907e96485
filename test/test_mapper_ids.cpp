/// Whoever follows the changes of the map may keep things by the ids of surfels: an id is given again only after its loss was told.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <set>

#include "map/change_readers.hpp"
#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

/// A copy of the map that is made from changes, and that notices when an id means another surfel without having been removed.
class Reader {
 public:
  /// @return whether the reader was known: it gets changes, and not the whole map
  bool read(const Mapper& mapper) {
    const Changes changes = mapper.changes(copy_.sequence());
    EXPECT_TRUE(changes.since == 0 || changes.since == copy_.sequence());
    const std::set<std::uint32_t> removed(changes.removed.begin(), changes.removed.end());
    std::map<std::uint32_t, Surfel> known;
    if (changes.since != 0)
      for (const Surfel& surfel : copy_.surfels()) known.emplace(surfel.id, surfel);
    for (const Surfel& surfel : changes.updated) {
      EXPECT_EQ(removed.count(surfel.id), 0u) << surfel.id << " is both removed and updated";
      const auto old = known.find(surfel.id);
      if (old == known.end()) continue;
      EXPECT_EQ(old->second.position, surfel.position) << surfel.id << " has become another surfel since " << copy_.sequence();
      EXPECT_EQ(old->second.normal, surfel.normal) << surfel.id << " has become another surfel since " << copy_.sequence();
      if (testing::Test::HasFailure()) break;
    }
    copy_.apply(changes);
    EXPECT_TRUE(same(copy_.surfels(), mapper.surfels()));
    return changes.since != 0;
  }

 private:
  Follower copy_;
};

/// A mapper that does everything that removes and adds surfels, a step at a time.
class MapperIds : public testing::Test {
 protected:
  void SetUp() override {
    for (const double depth : {2.5, 1.2, 0.55})  // surfels are split
      frames_.push_back(plane_frame(coarse_camera(), depth, look_along(-depth * forward_, forward_)));
  }
  void TearDown() override { std::remove(path_.c_str()); }

  void step(int n) {
    if (n == 4) mapper_.save(path_);
    if (n == 9 || n == 14) return mapper_.load(path_);
    if (n == 11) return mapper_.reset();
    removed_ += mapper_.integrate(frames_[n % frames_.size()].view()).removed;
  }

  static constexpr int kSteps = 20;
  const Eigen::Vector3d forward_{0, 1, 0};
  std::string path_ = (std::filesystem::temp_directory_path() / ("ids_" + std::to_string(getpid()) + ".ply")).string();
  Frames frames_ = orbit_frames(coarse_camera(), 6, 6);
  Mapper mapper_{undecimated()};
  std::size_t removed_ = 0;
};

TEST_F(MapperIds, AreGivenAgainOnlyAfterTheirLossWasTold) {
  Reader every_step, even_steps, odd_steps, third_steps, first_and_last;
  for (int n = 0; n < kSteps; ++n) {
    step(n);
    EXPECT_EQ(every_step.read(mapper_), n > 0);
    EXPECT_EQ((n % 2 == 0 ? even_steps : odd_steps).read(mapper_), n > 1);
    if (n % 3 == 2) {
      EXPECT_EQ(third_steps.read(mapper_), n > 2);
    }
    if (n == 0 || n == kSteps - 1) {
      EXPECT_EQ(first_and_last.read(mapper_), n > 0);
    }
    if (HasFailure()) return;
  }
  EXPECT_GT(removed_, 1000u);
}

/// Ids that a reader knows may belong to other surfels by now, if the mapper did not know that this reader has them. It gets the whole map.
TEST_F(MapperIds, OfReadersThatBeginLate) {
  Reader prompt;
  std::vector<std::vector<Surfel>> maps = {{}};  // by number
  for (int n = 0; n < kSteps; ++n) {
    step(n);
    prompt.read(mapper_);
    maps.push_back(mapper_.surfels());
  }
  std::size_t again = 0;
  for (const std::uint64_t since : {std::uint64_t{1}, std::uint64_t{3}, std::uint64_t{12}}) {
    SCOPED_TRACE("since " + std::to_string(since));
    const Changes changes = mapper_.changes(since);
    EXPECT_EQ(changes.since, 0u);
    EXPECT_EQ(changes.sequence, mapper_.sequence());
    EXPECT_TRUE(same(changes.updated, maps.back()));
    Changes then;
    then.updated = maps[since];
    Follower copy;  // not even a reader that does not look at Changes::since ends with a wrong map
    copy.apply(then);
    copy.apply(changes);
    EXPECT_TRUE(same(copy.surfels(), maps.back()));
    std::map<std::uint32_t, Surfel> known;
    for (const Surfel& surfel : maps[since]) known.emplace(surfel.id, surfel);
    for (const Surfel& surfel : changes.updated) {
      const auto old = known.find(surfel.id);
      again += old != known.end() && old->second.position != surfel.position;
    }
  }
  EXPECT_GT(again, 100u) << "ids are given again at last";
  EXPECT_TRUE(prompt.read(mapper_)) << "others are not disturbed";
}

/// What frames add and remove between two questions of a reader was never known to it, and takes no room.
TEST(MapperIdsOfAPlanner, SlotsOfShortLivedSurfelsAreUsedAgain) {
  const Frames frames = orbit_frames(coarse_camera(), 40);
  Mapper alone(undecimated()), followed(undecimated());
  Reader reader;
  std::size_t removed = 0, alone_bytes = 0, followed_bytes = 0;
  for (std::size_t n = 0; n < frames.size(); ++n) {
    if (n % 20 == 10) reader.read(followed);
    alone_bytes = alone.integrate(frames[n].view()).map_bytes;
    const Report report = followed.integrate(frames[n].view());
    followed_bytes = report.map_bytes;
    removed += report.removed;
  }
  reader.read(followed);
  EXPECT_GT(removed, 2 * alone.size()) << "too little is removed for this test";
  EXPECT_LE(static_cast<double>(followed_bytes), 1.5 * static_cast<double>(alone_bytes));
}

/// Slots of removed surfels are used again, so that following a map does not make it larger and larger.
TEST_F(MapperIds, FollowingTheMapAddsNoMemory) {
  Reader reader;
  std::size_t bytes[6];
  for (std::size_t& now : bytes) {
    for (const auto& frame : frames_) {
      mapper_.integrate(frame.view());
      reader.read(mapper_);
    }
    mapper_.reset();
    reader.read(mapper_);
    now = mapper_.statistics().device_bytes;
  }
  EXPECT_EQ(bytes[2], bytes[5]);
}

/// Reading the changes decides which slots surfels take, but not which surfels there are.
TEST_F(MapperIds, FollowingTheMapDoesNotChangeIt) {
  Mapper alone(undecimated());
  Reader reader;
  const auto places = [](const Mapper& mapper) {
    std::multiset<std::array<float, 8>> places;
    for (const Surfel& s : mapper.surfels())
      places.insert({s.position.x(), s.position.y(), s.position.z(), s.normal.x(), s.normal.y(), s.normal.z(), s.radius,
                     static_cast<float>(s.label)});
    return places;
  };
  for (int round = 0; round < 2; ++round) {
    for (const auto& frame : frames_) {
      alone.integrate(frame.view());
      mapper_.integrate(frame.view());
      reader.read(mapper_);
      ASSERT_TRUE(places(alone) == places(mapper_));
    }
  }
}

TEST_F(MapperIds, AReaderThatHasGoneDoesNotHoldThem) {
  Reader gone;
  integrate_all(mapper_, frames_);
  gone.read(mapper_);
  const std::vector<Surfel> old = mapper_.surfels();
  for (std::uint64_t n = 0; n < ChangeReaders::kLongestWait; ++n) mapper_.reset();
  integrate_all(mapper_, frames_);
  integrate_all(mapper_, frames_);
  std::set<std::uint32_t> ids;
  for (const Surfel& surfel : old) ids.insert(surfel.id);
  const std::vector<Surfel> now = mapper_.surfels();
  EXPECT_TRUE(std::any_of(now.begin(), now.end(), [&](const Surfel& surfel) { return ids.count(surfel.id) == 1; }));
  EXPECT_FALSE(gone.read(mapper_)) << "it comes back after all, and begins again";
  EXPECT_TRUE(gone.read(mapper_));
}

TEST(ChangeReadersTest, TheSlowestCounts) {
  ChangeReaders readers;
  EXPECT_TRUE(readers.maps().empty());
  EXPECT_FALSE(readers.knows(5));
  readers.note(0, 5);
  readers.note(0, 5);
  readers.note(5, 8);
  EXPECT_EQ(readers.maps().front(), 5u);
  EXPECT_TRUE(readers.knows(5));
  EXPECT_FALSE(readers.knows(4));
  readers.note(5, 9);
  EXPECT_EQ(readers.maps().front(), 8u);
  EXPECT_FALSE(readers.knows(5));
  EXPECT_FALSE(readers.forget_lost_ones(8 + ChangeReaders::kLongestWait));
  EXPECT_TRUE(readers.forget_lost_ones(9 + ChangeReaders::kLongestWait));
  EXPECT_EQ(readers.maps().front(), 9u);
  EXPECT_TRUE(readers.forget_lost_ones(10 + ChangeReaders::kLongestWait));
  EXPECT_TRUE(readers.maps().empty());
}

}  // namespace
}  // namespace frontier_surfels
