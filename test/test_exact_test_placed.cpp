/// The exact test of a world in which something is put down: what was seen in its place before does not count.
#include <gtest/gtest.h>

#include "exact_test_input.hpp"
#include "frontier_surfels/scoring/exact_test.hpp"

namespace frontier_surfels::scoring {
namespace {

// A camera of 160 x 120 pixels at the origin sees a wall at 2 m, in two frames. Before the second one, a box is put down whose front lies
// 1 m from the camera. It covers the middle of the image.

constexpr double kWall = 2.0, kFront = 1.0, kDepth = 0.3, kHalfWidth = 0.2;  // [m]
const Vector3d kTowards(0, 0, -1);

OrientedBox box() {
  OrientedBox box;
  box.T_frame_box.translation() = Vector3d(0, 0, kFront + kDepth / 2);
  box.half_size = Vector3d(kHalfWidth, kHalfWidth, kDepth / 2);
  return box;
}

OwnedFrame frame_of(bool with_box) {
  OwnedFrame frame({100, 100, 79.5, 59.5, 160, 120}, Eigen::Isometry3d::Identity(), Encoding::kMetresF32, 0, false);
  for (int t = 0; t < 120; ++t) {
    for (int s = 0; s < 160; ++s) {
      const bool on_box = std::max(std::abs(s - 79.5), std::abs(t - 59.5)) / 100 * kFront <= kHalfWidth;
      frame.set(s, t, with_box && on_box ? kFront : kWall);
    }
  }
  return frame;
}

/// Both frames.
ExactTest test_of_both() {
  ExactTest test(reading(0.5, 3, 1));
  for (const bool with_box : {false, true}) {
    OwnedFrame frame = frame_of(with_box);
    test.add(frame.view());
  }
  return test;
}

TEST(PlacedBox, IsUnknownAlthoughItsPlaceWasSeenBefore) {
  ExactTest test = test_of_both();
  EXPECT_TRUE(test.known({0, 0, 1.1}));
  test.set_placed({{box(), 1}});
  for (const double z : {1.001, 1.1, 1.299}) EXPECT_FALSE(test.known({0, 0, z})) << z;
  EXPECT_TRUE(test.known({0, 0, 0.999}));
  EXPECT_TRUE(test.known({0, 0, 1.301})) << "what was seen behind its place before is still empty";
  EXPECT_TRUE(test.known({0.201, 0, 1.1}));
  EXPECT_FALSE(test.known({0.199, 0, 1.1}));
  test.set_placed({});
  EXPECT_TRUE(test.known({0, 0, 1.1}));
}

TEST(PlacedBox, DoesNotHideWhatIsSeenAfterwards) {
  ExactTest test(reading(0.5, 3, 1));
  OwnedFrame with = frame_of(true), without = frame_of(false);
  test.add(with.view());
  test.add(without.view());  // it was taken away
  test.set_placed({{box(), 1}});
  EXPECT_TRUE(test.known({0, 0, 1.1}));
}

TEST(PlacedBox, ItsSeenFaceIsBoundaryAndTheOthersAreNotAsked) {
  ExactTest test = test_of_both();
  test.set_placed({{box(), 1}});
  std::size_t on_front = 0;
  for (const BoundaryPoint& point : test.boundary(20000, 5)) {
    if (box().distance(point.position) > 1e-3) continue;
    EXPECT_LT(point.position.z(), kFront + 0.033) << "occupied is what lies up to 3 cm behind a measured surface";
    EXPECT_TRUE(point.occupied);
    ++on_front;
  }
  EXPECT_GT(on_front, 300u);
  const ExactTest still = test_of_both();
  for (const BoundaryPoint& point : still.boundary(20000, 5)) EXPECT_GT(box().distance(point.position), 0.1);
}

TEST(PlacedBox, MapsAreJudgedByTheWorldAtTheEnd) {
  std::vector<Surfel> on_front;
  for (double x = -0.19; x < 0.2; x += 0.01) {
    for (double y = -0.19; y < 0.2; y += 0.01) on_front.push_back(make_surfel({x, y, kFront + 0.0005}, kTowards, 0.01, Label::kOccupied));
  }
  ExactTest test = test_of_both();
  EXPECT_EQ(test.score(on_front).buried, 1);
  const std::size_t points_before = test.score({}).boundary_points;
  test.set_placed({{box(), 1}});
  const ExactScore score = test.score(on_front);
  EXPECT_EQ(score.right, 1);
  EXPECT_EQ(score.fdr_2cm, 0);
  EXPECT_EQ(score.label_ok, 1);
  EXPECT_NE(score.boundary_points, points_before) << "the front is boundary now";
}

}  // namespace
}  // namespace frontier_surfels::scoring
