/// The map's pages: slots of new surfels, reuse of empty pages, and reported changes, compared with a simple book of all slots.

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "stages/map_book.hpp"

namespace frontier_surfels {
namespace {

using namespace reference;

using Numbers = std::vector<int>;
using Shares = std::vector<double>;

/// Surfels that the map has at first.
Numbers first_ones() { return small_tests() ? Numbers{500} : Numbers{0, 1, 3000}; }

TEST(StageMapPages, InsertedSurfelsTakeFreeSlotsInOrder) {
  for (const int there : first_ones())
    for (const int count : small_tests() ? Numbers{65} : Numbers{0, 1, 63, 64, 65, 5000, 20000}) {  // PoCL sorts few in one launch
      SCOPED_TRACE(std::to_string(there) + " surfels and " + std::to_string(count) + " more");
      Pages pages(static_cast<unsigned>(there + count));
      pages.fill(there);
      pages.remove(0.3);
      pages.open_window(4);
      pages.insert(count, 40);
      pages.insert(count / 3, 5);
      pages.expect_as_in_book();
    }
}

/// Slots of surfels that have not left the map yet count as free. A second insertion in the same frame cannot be prepared.
TEST(StageMapPages, NewSurfelsAreSortedBeforeOthersHaveLeft) {
  for (const int there : first_ones())
    for (const double share : small_tests() ? Shares{0.3} : Shares{0.0, 0.3, 1.0})
      for (const int count : small_tests() ? Numbers{100} : Numbers{0, 1, 700, 20000}) {
        SCOPED_TRACE(std::to_string(there) + " surfels and " + std::to_string(count) + " more, of the former leave " +
                     std::to_string(share));
        Pages pages(static_cast<unsigned>(there + count));
        pages.fill(there);
        pages.remove(0.3);
        pages.open_window(4);
        pages.insert(count, 40, share);
        pages.insert(count / 3, 5);
        pages.expect_as_in_book();
      }
}

/// Where the host does not wait, the device gives the same slots, unless there is something that the host must look at first.
TEST(StageMapPages, TheDeviceGoesOnByItself) {
  const bool is_near = test_commands().shape().is_near;
  const std::vector<Finding> obstacles = {{1, 0, 0, 0, 0}, {0, 1, 0, 0, 0}, {0, 0, 70000, 0, 0}, {0, 0, 0, 1, 0}, {0, 0, 0, 0, 1}};
  for (const int there : first_ones()) {
    Pages pages(static_cast<unsigned>(there));
    pages.fill(there);
    std::uint32_t frame = 2;
    const auto insert = [&](int count, int cells, double leave, const Finding& found) {
      SCOPED_TRACE(std::to_string(there) + " surfels and " + std::to_string(count) + " more, frame " + std::to_string(frame));
      pages.open_window(frame++);
      const bool goes_on = pages.insert(count, cells, leave, &found);
      pages.finish();
      pages.expect_as_in_book();
      return goes_on;
    };
    for (const double leave : small_tests() ? Shares{0.3} : Shares{0.0, 0.3, 1.0})
      for (const int count : small_tests() ? Numbers{100} : Numbers{0, 1, 700}) EXPECT_NE(insert(count, 20, leave, {}), is_near);
    for (std::size_t n = 0; n < (small_tests() ? 2 : obstacles.size()); ++n) EXPECT_FALSE(insert(100, 5, 0.3, obstacles[n]));
    EXPECT_NE(insert(100, 5, 0.3, {1, 0, 0, 0, 0, false}), is_near) << "evidence counts that nobody asked for";
    if (there == 0 || small_tests()) continue;
    EXPECT_FALSE(insert(70000, 40, 0.1, {})) << "more pages than the device has";
    EXPECT_NE(insert(70000, 40, 0.1, {}), is_near) << "not twice as many as in the frame before";
  }
}

/// Too little memory for more pages: the frame gets those that there are.
TEST(StageMapPages, TheDeviceGoesOnWithThePagesThatThereAre) {
  if (test_commands().shape().is_near || small_tests()) return;
  const Finding found;
  Pages pages(7);
  pages.fill(0);
  pages.open_window(2);
  pages.insert(70000, 40, 0);
  pages.finish();
  const auto room = [&] { return pages.map().bytes() + pages.map().untouched_bytes(); };
  const std::size_t before = room();
  std::size_t failing = 0;  // the number of the command that enlarges the map
  for (std::string fault = "none yet"; !fault.empty(); ++failing) {
    FaultInjection::fail(failing, 1);
    try {
      pages.open_window(3);
      fault = "";
    } catch (const cl::Error& error) {  // of a command before that
      fault = error.what();
      FaultInjection::stop();
      pages.map().roll_back();
    }
  }
  FaultInjection::stop();
  EXPECT_LE(room(), before);
  EXPECT_TRUE(pages.insert(500, 20, 0, &found));
  pages.finish();
  pages.expect_as_in_book();
  pages.open_window(4);
  EXPECT_GT(room(), before) << "there was no need to enlarge it";
}

/// A frame that fails after the device has gone on, or has not.
TEST(StageMapPages, AFrameThatWentAheadIsUndone) {
  for (const cl_uint large : {0, 1}) {
    Pages pages(6);
    pages.fill(3000);
    pages.open_window(2);
    const Finding found = {0, large, 0, 0, 0, true, true};
    EXPECT_EQ(pages.insert(700, 20, 0.3, &found), large == 0 && !test_commands().shape().is_near);
    pages.expect_as_in_book();
    pages.open_window(2);
    pages.insert(700, 20, 0.3);
    pages.finish();
    pages.expect_as_in_book();
  }
}

TEST(StageMapPages, ThousandsIntoOneBlock) {
  Pages pages(1);
  pages.fill(500);
  pages.open_window(4);
  for (const int count : small_tests() ? Numbers{64, 1} : Numbers{64, 1, 4000, 130}) pages.insert(count, 1);
  pages.expect_as_in_book();
}

/// More pages than a new map has room for, which is 1024: those that are there are kept.
TEST(StageMapPages, ManyPages) {
  constexpr std::size_t kRoom = 1024;
  Pages pages(2);
  pages.fill(0);
  pages.open_window(4);
  pages.insert(small_tests() ? 2000 : 30000, 60);
  EXPECT_LT(pages.book().pages.size(), kRoom);
  pages.insert(small_tests() ? 2500 : 50000, 60);
  EXPECT_TRUE(small_tests() || pages.book().pages.size() > kRoom) << pages.book().pages.size();
  pages.expect_as_in_book();
}

TEST(StageMapPages, EmptyPagesAreFreedAndUsedAgain) {
  Pages pages(3);
  pages.fill(2000);
  std::size_t most = pages.book().pages.size();
  for (int frame = 2; frame < (small_tests() ? 5 : 12); ++frame) {
    SCOPED_TRACE("frame " + std::to_string(frame));
    pages.open_window(frame);
    pages.insert(1500, 20);
    most = std::max(most, pages.book().pages.size());
    pages.remove(frame % 3 == 0 ? 1 : 0.9);
    pages.finish();
    pages.expect_as_in_book();
  }
  EXPECT_LT(pages.last_page(), most) << "free pages are not reused";
}

/// A frame's changes are reported exactly.
TEST(StageMapPages, ChangesAreReported) {
  Pages pages(4);
  pages.fill(3000);
  for (std::uint32_t frame = 2; frame < (small_tests() ? 4u : 8u); ++frame) {
    const std::map<std::uint32_t, Packed> before = pages.book().surfels;
    pages.open_window(frame);
    if (frame != 5) pages.insert(100, 3);
    pages.finish();
    std::set<std::uint32_t> told, expected;
    const Changes exact = pages.map().changes(frame - 1);
    EXPECT_TRUE(exact.removed.empty());
    for (const Surfel& surfel : exact.updated) told.insert(surfel.id);
    for (const auto& [slot, surfel] : pages.book().surfels)
      if (before.count(slot) == 0) expected.insert(slot);
    EXPECT_TRUE(told == expected) << "frame " << frame << ": " << told.size() << " surfels reported, " << expected.size() << " changed";
  }
}

TEST(StageMapPages, SlotsDoNotDependOnThreads) {
  const auto one_thread = one_thread_commands();
  if (one_thread == nullptr) GTEST_SKIP() << "The device " << test_commands().device().description << " cannot be limited to one thread.";
  std::vector<Book> books;
  for (Commands* with : {&test_commands(), one_thread.get()}) {
    Pages pages(5, *with);
    pages.fill(2000);
    for (int frame = 2; frame < 6; ++frame) {
      pages.open_window(frame);
      pages.insert(3000, 30);
      pages.remove(0.8);
      pages.finish();
    }
    books.push_back(pages.book());
  }
  EXPECT_TRUE(books[0].surfels == books[1].surfels);
  EXPECT_TRUE(books[0].pages == books[1].pages);
}

/// Pages near the window are listed once, and pages far from it are not.
TEST(StageMapPages, PagesNearTheWindow) {
  Pages pages(6);
  pages.fill(0);
  std::vector<Surfel> surfels(20000);
  for (Surfel& surfel : surfels) {
    for (int axis = 0; axis < 3; ++axis) surfel.position[axis] = static_cast<float>(pages.random().uniform(-20, 20));
    surfel.radius = 0.01F;
  }
  pages.map().replace(surfels, 1);
  pages.open_window(2);
  const Window& window = pages.map().window().window();
  for (const double distance : {0.0, 0.3, 5.0}) {
    DeviceArray<cl_uint> list(pages.fixture().commands());
    const std::size_t count = pages.map().list_pages_near(distance, list);
    const std::vector<cl_uint> listed = list.read(count);
    const std::set<std::uint32_t> near(listed.begin(), listed.end());
    EXPECT_EQ(near.size(), count);
    std::size_t inside = 0, outside = 0;
    for (const Surfel& surfel : pages.map().download()) {
      const double size = window.block_size;
      const Eigen::AlignedBox3d box(
          size * Eigen::Vector3d(window.origin_x, window.origin_y, window.origin_z),
          size * Eigen::Vector3d(window.origin_x + window.size_x, window.origin_y + window.size_y, window.origin_z + window.size_z));
      const Eigen::Vector3d p = surfel.position.cast<double>();
      const bool is_listed = near.count(surfel.id / PAGE_SLOTS) > 0;
      const double off = (p - p.cwiseMax(box.min()).cwiseMin(box.max())).cwiseAbs().maxCoeff();
      const bool must = off <= distance;
      const bool must_not = off > distance + size;
      inside += must;
      outside += must_not;
      EXPECT_TRUE(is_listed ? !must_not : !must) << p.transpose();
    }
    EXPECT_GT(inside, 10u);
    EXPECT_GT(outside, 10u);
  }
}

}  // namespace
}  // namespace frontier_surfels
