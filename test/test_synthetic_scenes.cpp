/// Things that come, go and move in the synthetic room.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scoring/object_faces.hpp"
#include "synthetic/synthetic_room.hpp"

namespace frontier_surfels::replay {
namespace {

using Eigen::Vector3d;
using scoring::OrientedBox;
using scoring::SceneObject;
using scoring::Stand;

constexpr int kFrames = 240;

struct SceneCase {
  const char* name;
  Scene scene;
  CameraPath path;
};
constexpr SceneCase kBoxes[] = {{"box_appears", Scene::kBoxAppears, CameraPath::kArc},
                                {"box_vanishes", Scene::kBoxVanishes, CameraPath::kArc},
                                {"box_returns", Scene::kBoxReturns, CameraPath::kArc}};
constexpr SceneCase kPerson = {"person_walks", Scene::kPersonWalks, CameraPath::kWatch};

std::vector<OrientedBox> boxes_in(const Room& room, std::size_t frame) {
  std::vector<OrientedBox> boxes;
  for (const SceneThing& thing : room.things()) {
    const Stand* stand = thing.object.stand_at(frame);
    if (stand == nullptr) continue;
    for (const OrientedBox& box : thing.object.placed(*stand)) boxes.push_back(box);
  }
  return boxes;
}

double distance_to(const std::vector<OrientedBox>& boxes, const Vector3d& p_world) {
  double distance = 1e9;
  for (const OrientedBox& box : boxes) distance = std::min(distance, box.distance(p_world));
  return distance;
}

TEST(Scenes, ThingsStandWhenTheyShould) {
  const auto stands = [](Scene scene) { return scene_things(scene, kFrames).at(0).object.stands; };
  EXPECT_TRUE(scene_things(Scene::kRoom, kFrames).empty());
  const auto appears = stands(Scene::kBoxAppears), vanishes = stands(Scene::kBoxVanishes), returns = stands(Scene::kBoxReturns);
  ASSERT_EQ(appears.size(), 1u);
  EXPECT_EQ(appears[0].first, 120u);
  EXPECT_EQ(appears[0].last, 239u);
  ASSERT_EQ(vanishes.size(), 1u);
  EXPECT_EQ(vanishes[0].first, 0u);
  EXPECT_EQ(vanishes[0].last, 119u);
  ASSERT_EQ(returns.size(), 2u);
  EXPECT_EQ(returns[0].last, 79u);
  EXPECT_EQ(returns[1].first, 160u);
  EXPECT_EQ(returns[1].last, 239u);
  const auto walk = stands(Scene::kPersonWalks);
  EXPECT_EQ(walk.front().first, 36u);
  EXPECT_EQ(walk.back().last, 191u);
  for (std::size_t i = 0; i + 1 < walk.size(); ++i) {
    EXPECT_EQ(walk[i + 1].first, walk[i].last + 1);
    const double step = (walk[i + 1].T_world_object.translation() - walk[i].T_world_object.translation()).norm();
    EXPECT_LT(step, 0.06) << "30 frames a second: a brisk walk";
  }
}

TEST(Scenes, ShortRecordingsHaveThemToo) {
  for (const Scene scene : {Scene::kBoxAppears, Scene::kBoxVanishes, Scene::kBoxReturns, Scene::kPersonWalks}) {
    for (const int frames : {1, 2, 3, 10}) {
      for (const SceneThing& thing : scene_things(scene, frames)) {
        EXPECT_EQ(thing.rgb.size(), thing.object.parts.size());
        for (const Stand& stand : thing.object.stands) EXPECT_LT(stand.last, static_cast<std::size_t>(frames));
      }
    }
  }
}

/// All points of the images lie on a surface of the room or of a thing, and between the camera and these points is nothing.
TEST(Scenes, ImagesShowTheThingsWhereTheyStand) {
  const Intrinsics camera = synthetic_camera(80, 60);
  for (const SceneCase& scene : {kBoxes[0], kPerson}) {
    const Room room(scene.scene, kFrames);
    int on_things = 0;
    for (int index = 0; index < kFrames; index += 7) {
      const RecordedFrame frame = room.render(index, kFrames, camera, scene.path);
      const auto boxes = boxes_in(room, static_cast<std::size_t>(index));
      for (int v = 0; v < camera.height; v += 3) {
        for (int u = 0; u < camera.width; u += 3) {
          const double z = frame.depth.at<float>(v, u);
          const Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
          const auto at = [&](double depth) -> Vector3d { return frame.T_world_camera * (depth * ray); };
          const double to_things = distance_to(boxes, at(z));
          EXPECT_NEAR(std::min(std::abs(room.distance(at(z))), to_things), 0, 1e-5) << scene.name << ", frame " << index;
          for (const double share : {0.3, 0.6, 0.9, 0.99})
            EXPECT_GT(std::min(room.distance(at(share * z)), distance_to(boxes, at(share * z))), 0) << scene.name << ", frame " << index;
          on_things += to_things < 1e-5;
        }
      }
    }
    EXPECT_GT(on_things, 300) << scene.name;
  }
}

TEST(Scenes, NothingRunsIntoAnything) {
  std::vector<SceneCase> all(std::begin(kBoxes), std::end(kBoxes));
  all.push_back(kPerson);
  for (const SceneCase& scene : all) {
    const Room room(scene.scene, kFrames);
    for (int index = 0; index < kFrames; ++index) {
      const auto boxes = boxes_in(room, static_cast<std::size_t>(index));
      const Vector3d eye = camera_pose(scene.path, index, kFrames).translation();
      EXPECT_GT(room.distance(eye), 0.25) << scene.name << ", frame " << index;
      EXPECT_GT(distance_to(boxes, eye), 0.5) << scene.name << ", frame " << index;
      if (index % 5 != 0) continue;
      for (const scoring::FacePoint& point : scoring::face_points(boxes))
        EXPECT_GT(room.distance(point.position), -1e-6) << scene.name << ", frame " << index << ": " << point.position.transpose();
    }
  }
}

/// For each side of the box but the bottom: the number of frames of a range in which most of the side would be seen at a cosine above 0.17.
std::vector<int> frames_that_see_each_side(const SceneCase& scene, int first, int end) {
  const SceneObject object = scene_things(scene.scene, kFrames).at(0).object;
  const Intrinsics camera = synthetic_camera(160, 120);
  const Room empty;
  std::vector<int> seen;
  for (const Vector3d& side : {Vector3d(1, 0, 0), Vector3d(-1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, -1, 0), Vector3d(0, 0, 1)}) {
    const Eigen::Isometry3d pose = object.stands[0].T_world_object * object.parts[0].T_frame_box;
    const scoring::FacePoint centre{pose * object.parts[0].half_size.cwiseProduct(side), pose.linear() * side};
    int frames = 0;
    for (int index = first; index < end; ++index) {
      const Eigen::Isometry3d T_world_camera = camera_pose(scene.path, index, kFrames);
      const Vector3d p = T_world_camera.inverse() * centre.position;
      const Vector3d to_camera = (T_world_camera.translation() - centre.position).normalized();
      const double u = camera.fx * p.x() / p.z() + camera.cx, v = camera.fy * p.y() / p.z() + camera.cy;
      const bool inside = p.z() > 0 && p.z() < 3 && u > 0 && v > 0 && u < camera.width && v < camera.height;
      frames += inside && to_camera.dot(centre.normal) > 0.17 && empty.depth(T_world_camera, camera, u, v) > p.z() - 0.01;
    }
    seen.push_back(frames);
  }
  return seen;
}

TEST(Scenes, TheBoxsPlaceIsSeenFromSeveralSidesBeforeAndAfter) {
  for (const SceneCase& scene : kBoxes) {
    const bool in_thirds = scene.scene == Scene::kBoxReturns;
    for (int part = 0; part < (in_thirds ? 3 : 2); ++part) {
      const int length = kFrames / (in_thirds ? 3 : 2);
      const std::vector<int> seen = frames_that_see_each_side(scene, part * length, (part + 1) * length);
      const auto sides = std::count_if(seen.begin(), seen.end(), [](int frames) { return frames >= 12; });
      EXPECT_GE(sides, 4) << scene.name << ", part " << part;
    }
  }
}

/// Before the person comes, and after it has gone, the camera sees the places where it was seen.
TEST(Scenes, ThePersonsPlacesAreSeenBeforeAndAfterwards) {
  const Room room(kPerson.scene, kFrames);
  const Intrinsics camera = synthetic_camera(160, 120);
  const SceneObject& person = room.things().at(0).object;
  const auto is_seen = [&](const Vector3d& p_world, int first, int end) {
    for (int index = first; index < end; ++index) {
      const Eigen::Isometry3d T_world_camera = camera_pose(kPerson.path, index, kFrames);
      const Vector3d p = T_world_camera.inverse() * p_world;
      const double u = camera.fx * p.x() / p.z() + camera.cx, v = camera.fy * p.y() / p.z() + camera.cy;
      const bool inside = p.z() > 0 && u > 0 && v > 0 && u < camera.width && v < camera.height;
      if (inside && p.z() < 3 && room.depth(T_world_camera, camera, u, v) > p.z()) return true;
    }
    return false;
  };
  int shown = 0, before = 0, after = 0;
  for (const Stand& stand : person.stands) {
    const Vector3d chest = stand.T_world_object * Vector3d(0, 0, 1.2);
    const int frame = static_cast<int>(stand.first);
    if (!is_seen(chest, frame, frame + 1)) continue;
    ++shown;
    before += is_seen(chest, 0, static_cast<int>(person.stands.front().first));
    after += is_seen(chest, static_cast<int>(person.stands.back().last) + 1, kFrames);
  }
  EXPECT_GT(shown, 60);
  EXPECT_GT(before, 0.8 * shown);
  EXPECT_GT(after, 0.9 * shown);
  for (const std::size_t at : {person.stands.front().first, person.stands.back().last}) {
    const Stand* stand = person.stand_at(at);
    const int frame = static_cast<int>(at);
    for (const double z : {0.3, 1.2, 1.6}) EXPECT_FALSE(is_seen(stand->T_world_object * Vector3d(0, 0, z), frame, frame + 1)) << z;
  }
}

}  // namespace
}  // namespace frontier_surfels::replay
