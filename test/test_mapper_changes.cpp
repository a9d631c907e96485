/// The changes since a sequence number, and parts of the map.
#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <filesystem>
#include <set>

#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

using Map = std::vector<Surfel>;

const Surfel* find(const Map& map, std::uint32_t id) {
  const auto found = std::lower_bound(map.begin(), map.end(), id, [](const Surfel& s, std::uint32_t wanted) { return s.id < wanted; });
  return found != map.end() && found->id == id ? &*found : nullptr;
}

/// A mapper after all kinds of operations, and its map at every sequence number.
class MapperChanges : public testing::Test {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() / ("changes_" + std::to_string(getpid()) + ".ply")).string();
    note();
    const Frames frames = orbit_frames(coarse_camera(), 6, 6);
    for (int n = 0; n < 4; ++n) integrate(frames[n]);
    mapper_.save(path_);
    integrate(frames[4]);
    mapper_.load(path_);  // a smaller map, so that some ids become free
    note();
    integrate(frames[5]);
    integrate(plane_frame(coarse_camera(), 0, replay::orbit_pose(0, 200)));  // nothing changes
    mapper_.reset();
    note();
    const Eigen::Vector3d forward(0, 1, 0);
    for (const double depth : {2.5, 1.2, 0.55}) integrate(plane_frame(coarse_camera(), depth, look_along(-depth * forward, forward)));
    mapper_.load(path_);
    note();
    integrate(frames[0]);
  }
  void TearDown() override { std::remove(path_.c_str()); }

  void integrate(const replay::RecordedFrame& frame) {
    const Report report = mapper_.integrate(frame.view());
    note();
    EXPECT_EQ(report.sequence, mapper_.sequence());
    EXPECT_EQ(report.surfels, maps_.back().size());
    split_ += report.split;
  }

  void note() {
    ASSERT_EQ(mapper_.sequence(), maps_.size()) << "every frame, reset and load counts one up";
    maps_.push_back(mapper_.surfels());
    EXPECT_TRUE(all_sound(maps_.back()));
    const Changes changes = mapper_.changes(follower_.sequence());
    EXPECT_EQ(changes.sequence, mapper_.sequence());
    follower_.apply(changes);
    EXPECT_TRUE(same(follower_.surfels(), maps_.back())) << "followed to " << mapper_.sequence();
  }

  std::string path_;
  Mapper mapper_{undecimated()};
  std::vector<Map> maps_;  ///< [sequence]
  Follower follower_;      ///< asks after every step
  std::size_t split_ = 0;
};

TEST_F(MapperChanges, LeadFromAnyEarlierMapToThisOne) {
  EXPECT_GT(split_, 0u);
  for (std::uint64_t since = 0; since < maps_.size(); ++since) {
    SCOPED_TRACE("since " + std::to_string(since));
    Changes then;
    then.updated = maps_[since];
    Follower follower;
    follower.apply(then);
    const Changes changes = mapper_.changes(since);
    follower.apply(changes);
    EXPECT_TRUE(same(follower.surfels(), maps_.back()));
    EXPECT_EQ(follower.sequence(), mapper_.sequence());

    for (const Surfel& surfel : changes.updated) ASSERT_NE(find(maps_.back(), surfel.id), nullptr) << surfel.id;
    for (const std::uint32_t id : changes.removed) ASSERT_EQ(find(maps_.back(), id), nullptr) << id;
    std::set<std::uint32_t> ids(changes.removed.begin(), changes.removed.end());
    EXPECT_EQ(ids.size(), changes.removed.size()) << "an id is reported twice";
  }
}

TEST_F(MapperChanges, NothingSinceNow) {
  const Changes changes = mapper_.changes(mapper_.sequence());
  EXPECT_TRUE(changes.updated.empty());
  EXPECT_TRUE(changes.removed.empty());
  EXPECT_EQ(changes.since, mapper_.sequence());
  EXPECT_EQ(changes.sequence, mapper_.sequence());
}

/// Such a number is of another mapper's map, perhaps of one that has been started again.
TEST_F(MapperChanges, SinceANumberThatHasNotComeAreTheWholeMap) {
  for (const std::uint64_t since : {mapper_.sequence() + 1, ~std::uint64_t{0}}) {
    const Changes changes = mapper_.changes(since);
    EXPECT_EQ(changes.since, 0u);
    EXPECT_EQ(changes.sequence, mapper_.sequence());
    EXPECT_TRUE(same(changes.updated, maps_.back()));
  }
}

/// The changes of the last frame contain what it has changed, and no more.
TEST(MapperChange, OfTheLastFrameIsExact) {
  Mapper mapper(undecimated());
  integrate_all(mapper, orbit_frames(coarse_camera(), 4, 5));
  mapper.changes(0);  // a reader, whose ids are kept
  const Map before = mapper.surfels();
  const Report report = mapper.integrate(orbit_frames(coarse_camera(), 5, 5).back().view());
  const Changes changes = mapper.changes(mapper.sequence() - 1);
  std::size_t added = 0, changed = 0, unchanged = 0;
  for (const Surfel& surfel : changes.updated) {
    const Surfel* old = find(before, surfel.id);
    ++(old == nullptr ? added : same(*old, surfel) ? unchanged : changed);
    if (old != nullptr) {
      EXPECT_EQ(old->position, surfel.position) << "an id is given again";
    }
  }
  EXPECT_EQ(added, report.created);
  EXPECT_EQ(unchanged, 0u);
  EXPECT_GT(changed, 0u) << "frontier becomes occupied";
  EXPECT_LT(changes.updated.size(), before.size());
  EXPECT_EQ(before.size() + report.created - report.removed, report.surfels);

  std::set<std::uint32_t> old_ids;
  for (const Surfel& surfel : before) old_ids.insert(surfel.id);
  for (const std::uint32_t id : changes.removed) EXPECT_EQ(old_ids.count(id), 1u) << id << " was not in the map";
  EXPECT_GT(report.removed, 0u);
  EXPECT_EQ(changes.removed.size(), report.removed);
}

/// Readers that ask now and then get what one that asks after each frame has got meanwhile, and no more.
TEST(MapperChange, SinceAReadersLastQuestionAreExact) {
  struct Reader {
    std::uint64_t every;
    Follower follower;
    std::set<std::uint32_t> touched;  ///< ids that frames have touched since its last question
  };
  Mapper mapper(undecimated());
  std::vector<Reader> readers = {{1, {}, {}}, {2, {}, {}}, {3, {}, {}}, {5, {}, {}}};
  std::size_t asked = 0;
  for (const auto& frame : orbit_frames(coarse_camera(), 16, 16)) {
    mapper.integrate(frame.view());
    for (Reader& reader : readers) {
      if (mapper.sequence() % reader.every != 0) continue;
      const bool first = reader.follower.sequence() == 0;
      const Changes changes = mapper.changes(reader.follower.sequence());
      std::set<std::uint32_t> told(changes.removed.begin(), changes.removed.end());
      for (const Surfel& surfel : changes.updated) told.insert(surfel.id);
      reader.follower.apply(changes);
      EXPECT_TRUE(same(reader.follower.surfels(), mapper.surfels())) << "every " << reader.every;
      if (reader.every == 1) {
        for (Reader& other : readers) other.touched.insert(told.begin(), told.end());
      } else if (!first) {
        EXPECT_TRUE(std::includes(reader.touched.begin(), reader.touched.end(), told.begin(), told.end())) << "every " << reader.every;
        ++asked;
      }
      reader.touched.clear();
    }
  }
  EXPECT_GE(asked, 12u);
}

/// Number of surfels made by splitting the parent once: with half its radius r, and r / 2 away from its centre.
std::size_t quarters(const Surfel& parent, const Map& map) {
  return static_cast<std::size_t>(std::count_if(map.begin(), map.end(), [&](const Surfel& s) {
    return s.radius == parent.radius / 2 && s.label == parent.label && s.normal == parent.normal &&
           std::abs((s.position - parent.position).norm() - parent.radius / 2) < 2e-5F;
  }));
}

/// Splitting replaces a surfel by four, and the report's numbers add up.
TEST(MapperChange, SplitSurfelsAreReplacedByFour) {
  Mapper mapper(undecimated());
  const Eigen::Vector3d forward(0, 1, 0);
  mapper.integrate(plane_frame(coarse_camera(), 2.5, look_along(-2.5 * forward, forward)).view());
  const Map before = mapper.surfels();
  const Report report = mapper.integrate(plane_frame(coarse_camera(), 0.52, look_along(-0.52 * forward, forward)).view());
  const Map after = mapper.surfels();

  std::set<std::array<float, 3>> places;
  for (const Surfel& s : after) places.insert({s.position.x(), s.position.y(), s.position.z()});
  std::size_t split = 0;
  for (const Surfel& old : before) {
    if (places.count({old.position.x(), old.position.y(), old.position.z()}) || quarters(old, after) == 0) continue;
    ++split;
    EXPECT_EQ(quarters(old, after), 4u);
  }
  EXPECT_GT(split, 100u);
  EXPECT_EQ(report.split, 3 * split) << "each split adds three surfels";
  EXPECT_EQ(after.size(), before.size() + report.split + report.created - report.removed);
}

TEST(MapperBox, HoldsTheSurfelsInside) {
  Mapper mapper(undecimated());
  integrate_all(mapper, orbit_frames(coarse_camera(), 2, 5));
  const Map all = mapper.surfels();
  const Eigen::AlignedBox3f box(Eigen::Vector3f(-0.5, -0.7, 0.3), Eigen::Vector3f(0.6, 0.5, 1.1));
  Map inside;
  for (const Surfel& s : all)
    if ((s.position.array() >= box.min().array()).all() && (s.position.array() <= box.max().array()).all()) inside.push_back(s);
  ASSERT_GT(inside.size(), 100u);
  ASSERT_LT(inside.size(), all.size());
  EXPECT_TRUE(same(inside, mapper.surfels(box)));

  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(same(all, mapper.surfels(Eigen::AlignedBox3f(Eigen::Vector3f::Constant(-infinity), Eigen::Vector3f::Constant(infinity)))));
  EXPECT_TRUE(mapper.surfels(Eigen::AlignedBox3f()).empty());
  EXPECT_EQ(mapper.surfels(Eigen::AlignedBox3f(all[7].position)).size(), 1u) << "the border belongs to the box";
}

/// Readers of a paused mapper go on asking, and each answer launches kernels.
TEST(PausedMapper, TakesNoMemoryForItsAnswers) {
  Mapper mapper(undecimated());
  for (const auto& frame : orbit_frames(coarse_camera(), 12, 3)) mapper.integrate(frame.view());
  const auto expect_bounded = [](const char* name, const auto& ask) {
    const auto ask_often = [&](int times) {
      for (int n = 0; n < times; ++n) ask();
      return mallinfo2().uordblks;  // [byte] that are allocated
    };
    const std::size_t before = ask_often(100), after = ask_often(1000);
    EXPECT_LT(after, before + (std::size_t{100} << 10)) << name;
  };
  expect_bounded("surfels", [&] { mapper.surfels(); });
  expect_bounded("changes", [&] { mapper.changes(mapper.sequence()); });
  expect_bounded("changes of the last frame", [&] { mapper.changes(mapper.sequence() - 1); });
  expect_bounded("reset", [&] { mapper.reset(); });
}

}  // namespace
}  // namespace frontier_surfels
