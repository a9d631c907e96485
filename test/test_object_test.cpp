/// The scores of objects, on scenes whose answers are computed by hand.
#include <gtest/gtest.h>

#include "exact_test_input.hpp"
#include "frontier_surfels/scoring/object_test.hpp"
#include "scoring/object_faces.hpp"

namespace frontier_surfels::scoring {
namespace {

// A camera of 200 x 200 pixels at the origin looks along z at a wall at 2.5 m. From some frame on, a box of 0.2 x 0.2 x 0.2 m stands before
// it, with its front at 1 m.

constexpr double kWall = 2.5, kFront = 1.0, kSize = 0.2;  // [m]
const Vector3d kTowards(0, 0, -1);

SceneObject box_in(const std::vector<std::pair<std::size_t, std::size_t>>& stands) {
  SceneObject object{"box", {{Eigen::Isometry3d::Identity(), Vector3d::Constant(kSize / 2)}}, {}};
  const Eigen::Isometry3d pose(Eigen::Translation3d(0, 0, kFront + kSize / 2));
  for (const auto& [first, last] : stands) object.stands.push_back({first, last, pose});
  return object;
}

OwnedFrame frame_of(bool with_box) {
  OwnedFrame frame({200, 200, 99.5, 99.5, 200, 200}, Eigen::Isometry3d::Identity(), Encoding::kMetresF32, 0, false);
  for (int t = 0; t < 200; ++t) {
    for (int s = 0; s < 200; ++s) {
      const bool on_box = std::max(std::abs(s - 99.5), std::abs(t - 99.5)) / 200 * kFront <= kSize / 2;
      frame.set(s, t, with_box && on_box ? kFront : kWall);
    }
  }
  return frame;
}

ObjectTest::SurfelsIn map_of(const std::vector<Surfel>& surfels) {
  return [surfels](const Eigen::AlignedBox3d& box) {
    std::vector<Surfel> inside;
    for (const Surfel& surfel : surfels)
      if (box.contains(surfel.position.cast<double>())) inside.push_back(surfel);
    return inside;
  };
}

/// Surfels on the box's front, where x is from `low` to `high`.
std::vector<Surfel> front(double low, double high, Label label = Label::kOccupied) {
  std::vector<Surfel> surfels;
  for (double x = low; x < high; x += 0.01) {
    for (double y = -0.1; y < 0.1; y += 0.01) surfels.push_back(make_surfel({x, y, kFront}, kTowards, 0.01, label));
  }
  return surfels;
}

/// A test that has got frames `begin` to before `end`; the map is the same in all.
void add(ObjectTest& test, std::size_t begin, std::size_t end, bool with_box, const std::vector<Surfel>& map) {
  OwnedFrame frame = frame_of(with_box);
  for (std::size_t index = begin; index < end; ++index) test.add(index, frame.view(), map_of(map));
}

TEST(FacePoints, LieOnAllFacesButInNoOtherBox) {
  const OrientedBox large{Eigen::Isometry3d::Identity(), {0.1, 0.05, 0.2}};
  const auto points = face_points({large});
  EXPECT_EQ(points.size(), 2u * (20 * 10 + 10 * 40 + 20 * 40));
  Vector3d sum = Vector3d::Zero();
  for (const FacePoint& point : points) {
    EXPECT_NEAR(((point.position.cwiseAbs() - large.half_size).maxCoeff()), 0, 1e-12);
    EXPECT_FALSE(large.contains(point.position + 1e-6 * point.normal));
    EXPECT_TRUE(large.contains(point.position - 1e-6 * point.normal));
    sum += point.normal;
  }
  EXPECT_NEAR(sum.norm(), 0, 1e-9);
  OrientedBox above = large;
  above.T_frame_box.translation().z() = 0.4;  // stands on it
  EXPECT_EQ(face_points({large, above}).size(), 2 * points.size() - 2 * 20 * 10);
}

TEST(SeenCosine, IsThatOfTheRayAndZeroWhereNothingIsSeen) {
  OwnedFrame open = frame_of(false), hidden = frame_of(true);
  const DepthReading range(reading(0.5, 3, 1));
  const FacePoint ahead{{0, 0, 2}, kTowards}, aside{{0.5, 0, 2}, kTowards}, slanted{{0, 0, 2}, Vector3d(1, 0, -1).normalized()};
  EXPECT_NEAR(seen_cosine(ahead, open.view(), range), 1, 1e-12);
  EXPECT_NEAR(seen_cosine(aside, open.view(), range), 2 / std::hypot(2, 0.5), 1e-12);
  EXPECT_NEAR(seen_cosine(slanted, open.view(), range), std::sqrt(0.5), 1e-12);
  EXPECT_EQ(seen_cosine(ahead, hidden.view(), range), 0) << "behind the box";
  EXPECT_EQ(seen_cosine({{0, 0, 2}, -kTowards}, open.view(), range), 0) << "faces away";
  EXPECT_EQ(seen_cosine({{1.1, 0, 2}, kTowards}, open.view(), range), 0) << "outside of the image";
  EXPECT_EQ(seen_cosine({{0, 0, -2}, -kTowards}, open.view(), range), 0) << "behind the camera";
  EXPECT_EQ(seen_cosine(ahead, open.view(), DepthReading(reading(0.5, 1.9, 1))), 0) << "farther than z_max";
  EXPECT_EQ(seen_cosine(ahead, open.view(), DepthReading(reading(2.1, 3, 1))), 0) << "nearer than z_min";
}

TEST(ObjectTest, CountsWhatIsSeenAndWhatOfThisIsCovered) {
  ObjectTest test(reading(0.5, 3, 1), {box_in({{5, 100}})});
  add(test, 0, 5, false, {});
  add(test, 5, 14, true, front(-0.1, 0));  // frame 5 is the first view, and frame 13 the eighth after it
  add(test, 14, 20, true, front(-0.1, 0.1));
  const auto scores = test.score(map_of(front(-0.1, 0.1)));
  ASSERT_EQ(scores.size(), 1u);
  ASSERT_EQ(scores[0].stands.size(), 1u);
  const StandScore& stand = scores[0].stands[0];
  EXPECT_EQ(stand.first_seen, 5u);
  EXPECT_FALSE(scores[0].left) << "it is still there";
  for (const FacesScore& faces : stand.faces) {
    ASSERT_TRUE(faces.early && faces.end);
    EXPECT_EQ(faces.early->points, 400u) << "the front alone";
    // The surfels end at x = -0.01: within 2 cm of these are the points up to x = 0.01, some of them in the last column only nearly.
    EXPECT_NEAR(faces.early->share, 0.55, 0.051);
    EXPECT_EQ(faces.end->points, 400u);
    EXPECT_EQ(faces.end->share, 1);
  }
}

TEST(ObjectTest, FrontierSurfelsCoverNothing) {
  ObjectTest test(reading(0.5, 3, 1), {box_in({{0, 100}})});
  add(test, 0, 20, true, front(-0.1, 0.1, Label::kFrontier));
  const auto scores = test.score(map_of(front(-0.1, 0.1, Label::kFrontier)));
  EXPECT_EQ(scores[0].stands[0].faces[0].end->share, 0);
}

TEST(ObjectTest, AStandThatEndsIsJudgedByTheMapThen) {
  ObjectTest test(reading(0.5, 3, 1), {box_in({{0, 19}, {40, 60}})});
  add(test, 0, 20, true, front(-0.1, 0.1));
  add(test, 20, 40, false, {});
  add(test, 40, 50, true, {});
  const auto stands = test.score(map_of({}))[0].stands;
  ASSERT_EQ(stands.size(), 2u);
  EXPECT_EQ(stands[0].faces[0].end->share, 1);
  EXPECT_EQ(stands[1].first_seen, 40u);
  EXPECT_EQ(stands[1].faces[0].end->share, 0);
}

TEST(ObjectTest, ShortStandsAndUnseenObjectsHaveNoShares) {
  SceneObject aside = box_in({{0, 50}});
  aside.name = "aside";
  aside.stands[0].T_world_object.translation().x() = 5;
  ObjectTest test(reading(0.5, 3, 1), {box_in({{0, 7}}), aside});
  add(test, 0, 20, false, {});
  const auto scores = test.score(map_of({}));
  EXPECT_TRUE(scores[0].stands.empty());
  ASSERT_EQ(scores[1].stands.size(), 1u);
  EXPECT_FALSE(scores[1].stands[0].first_seen);
  EXPECT_FALSE(scores[1].stands[0].faces[0].early);
}

/// The box stands there up to frame 9; from frame 10 on, the camera sees through its place.
TEST(ObjectTest, SurfelsAreLeftOnceTheOpenSpaceAroundThemWasSeenTenFramesAgo) {
  const auto left_after = [](std::size_t frames, const std::vector<Surfel>& map) {
    ObjectTest test(reading(0.5, 3, 1), {box_in({{0, 9}})});
    add(test, 0, 10, true, map);
    add(test, 10, 10 + frames, false, map);
    return test.score(map_of(map))[0];
  };
  const Surfel in_place = make_surfel({0, 0, kFront}, kTowards, 0.01, Label::kOccupied);
  EXPECT_FALSE(left_after(0, {in_place}).left);
  EXPECT_EQ(left_after(10, {in_place}).left->occupied, 0u) << "the mapper has had nine frames only";
  EXPECT_EQ(left_after(11, {in_place}).left->occupied, 1u);
  EXPECT_EQ(left_after(11, {in_place}).most_left->occupied, 1u);

  const Surfel frontier = make_surfel({0.05, 0.05, kFront + 0.1}, kTowards);
  EXPECT_EQ(left_after(20, {in_place, frontier}).left->frontier, 1u);
  EXPECT_EQ(left_after(20, {in_place, frontier}).left->occupied, 1u);

  const Surfel elsewhere = make_surfel({0.13, 0, kFront}, kTowards, 0.01, Label::kOccupied);
  const Surfel on_its_rim = make_surfel({0.115, 0, kFront + 0.1}, kTowards, 0.01, Label::kOccupied);
  EXPECT_EQ(left_after(20, {elsewhere}).left->occupied, 0u) << "3 cm beside its place";
  EXPECT_EQ(left_after(20, {on_its_rim}).left->occupied, 1u) << "1.5 cm beside its place";
}

TEST(ObjectTest, SurfelsOnASurfaceThatItStoodOnAreNotLeft) {
  SceneObject object = box_in({{0, 9}});
  object.stands[0].T_world_object.translation().z() = kWall - kSize / 2;  // it leans against the wall
  ObjectTest test(reading(0.5, 3, 1), {object});
  const std::vector<Surfel> map = {make_surfel({0, 0, kWall}, kTowards, 0.01, Label::kOccupied),
                                   make_surfel({0, 0, kWall - 0.01}, kTowards, 0.01, Label::kOccupied),
                                   make_surfel({0, 0, kWall - 0.03}, kTowards, 0.01, Label::kOccupied)};
  add(test, 0, 10, true, map);
  add(test, 10, 30, false, map);
  EXPECT_EQ(test.score(map_of(map))[0].left->occupied, 1u) << "the one 3 cm before the wall";
}

TEST(ObjectTest, ThePlaceOfAMovingObjectIsWhereItIsNow) {
  SceneObject object = box_in({});
  for (std::size_t index = 0; index < 10; ++index) {
    const Eigen::Isometry3d pose(Eigen::Translation3d(index < 5 ? 0 : 0.3, 0, kFront + kSize / 2));
    object.stands.push_back({index, index, pose});
  }
  object.stands.push_back({10, 40, object.stands.back().T_world_object});
  ObjectTest test(reading(0.5, 3, 1), {object});
  const std::vector<Surfel> map = {make_surfel({0, 0, kFront}, kTowards, 0.01, Label::kOccupied),
                                   make_surfel({0.3, 0, kFront}, kTowards, 0.01, Label::kOccupied)};
  add(test, 0, 30, false, map);
  EXPECT_EQ(test.score(map_of(map))[0].left->occupied, 1u) << "of the two, one is where the object stands";
}

TEST(ObjectTest, WithoutTheMapAfterEachFrameThereAreOnlyFiguresOfTheEnd) {
  ObjectTest test(reading(0.5, 3, 1), {box_in({{0, 9}, {30, 99}})});
  OwnedFrame with = frame_of(true), without = frame_of(false);
  for (std::size_t index = 0; index < 45; ++index)
    test.add(index, (index < 10 || index >= 30 ? with : without).view(), ObjectTest::SurfelsIn());
  const ObjectScore score = test.score(map_of(front(-0.1, 0.1)))[0];
  EXPECT_FALSE(score.stands[0].faces[0].end);
  EXPECT_FALSE(score.stands[1].faces[0].early);
  EXPECT_EQ(score.stands[1].faces[0].end->share, 1);
  EXPECT_TRUE(score.left);
  EXPECT_FALSE(score.most_left);
}

}  // namespace
}  // namespace frontier_surfels::scoring
