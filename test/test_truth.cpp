/// The folder of ideal frames: objects.json, every mismatch with the recording, and what it says of a world that changes.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>

#include "apps/sequence_writer.hpp"
#include "recordings/objects_file.hpp"
#include "recordings/truth_folder.hpp"
#include "replay/truth.hpp"
#include "synthetic/synthetic_room.hpp"
#include "temporary_folder.hpp"

namespace frontier_surfels::replay {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using scoring::SceneObject;

constexpr int kFrames = 12;

Config working_size() {
  Config config;
  config.decimation = 1;
  return config;
}

/// A folder that is removed after the test.
class TruthTest : public testing::Test {
 protected:
  fs::path recording() const { return folder_ / "recording"; }
  fs::path truth() const { return folder_ / "truth"; }

  /// Writes a recording and its truth.
  void write(Scene scene = Scene::kRoom, const SensorModel& sensor = {}, int frames = kFrames) const {
    const Intrinsics camera = synthetic_camera(80, 60);
    const Room room(scene, frames);
    SequenceWriter measured(recording(), camera), ideal(truth(), camera);
    for (int index = 0; index < frames; ++index) {
      const SensedFrame frame = room.sense(index, frames, camera, sensor, CameraPath::kArc);
      measured.add(frame.measured);
      ideal.add(frame.ideal);
    }
    measured.close();
    ideal.close();
    std::vector<SceneObject> objects;
    for (const SceneThing& thing : room.things()) objects.push_back(thing.object);
    if (!objects.empty()) write_text(truth() / "objects.json", objects_text(objects));
  }

  std::string read_text(const fs::path& path) const {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

  /// The message with which the truth is refused; empty if it is not.
  std::string failure() const {
    try {
      TruthFolder(truth().string(), recording().string());
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  }

  const TemporaryFolder temporary_{"truth"};
  const fs::path folder_ = temporary_.path();
};

testing::AssertionResult says(const std::string& sentence, const std::string& part) {
  if (sentence.find(part) != std::string::npos && sentence.find('\n') == std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << part << "' is not in '" << sentence << "'";
}

TEST_F(TruthTest, FloatsAreReadBackBitForBit) {
  write();
  const Room room;
  TruthFolder folder(truth().string(), recording().string());
  const auto recorded = open_source(recording().string());
  for (int index = 0; index < kFrames; ++index) {
    const RecordedFrame expected = room.render(index, kFrames, synthetic_camera(80, 60), CameraPath::kArc);
    const RecordedFrame ideal = folder.frame_for(static_cast<std::size_t>(index), recorded->next()->view());
    ASSERT_EQ(ideal.depth.type(), CV_32FC1);
    EXPECT_EQ(cv::norm(ideal.depth, expected.depth, cv::NORM_INF), 0);
    EXPECT_TRUE(ideal.T_world_camera.isApprox(expected.T_world_camera, 1e-14));
  }
}

TEST_F(TruthTest, ARecordingIsTakenAsATruth) {
  write();
  fs::remove_all(truth());
  fs::copy(recording(), truth(), fs::copy_options::recursive);  // 16 bits
  EXPECT_EQ(failure(), "");
}

TEST_F(TruthTest, NoisyPosesAreNoMismatch) {
  SensorModel sensor;
  sensor.position_noise = 0.05;
  sensor.rotation_noise = 0.05;
  write(Scene::kRoom, sensor);
  EXPECT_EQ(failure(), "");
}

TEST_F(TruthTest, MismatchesGetASentence) {
  write();
  const std::string poses = read_text(truth() / "poses.txt"), camera = read_text(truth() / "camera.txt");
  const auto line = [&](int number) {  // the first line is a comment
    std::size_t begin = 0;
    for (int i = 0; i < number; ++i) begin = poses.find('\n', begin) + 1;
    return poses.substr(begin, poses.find('\n', begin) + 1 - begin);
  };
  const auto with_line = [&](int number, const std::string& text) {
    std::string changed = poses;
    return changed.replace(poses.find(line(number)), line(number).size(), text);
  };
  const std::string stamp = line(4).substr(0, line(4).find(' '));

  write_text(truth() / "poses.txt", with_line(4, "77" + line(4).substr(stamp.size())));
  EXPECT_TRUE(says(failure(), "must have the same frames as the recording, but frame 3 has the stamp 77.000000 instead of 1.1"));
  write_text(truth() / "poses.txt", with_line(4, stamp + " 9 9 9 0 0 0 1\n"));
  EXPECT_TRUE(says(failure(), "but frame 3 has a pose 1"));
  write_text(truth() / "poses.txt", with_line(4, stamp + " nan 9 9 0 0 0 1\n"));
  EXPECT_TRUE(says(failure(), "frame 3 has no pose"));
  write_text(truth() / "poses.txt", poses);

  write_text(truth() / "camera.txt", "70 70 40 30 81 60\n");
  EXPECT_TRUE(says(failure(), "its camera has 81x60 pixels"));
  write_text(truth() / "camera.txt", "70 70 40 30 80 60\n");
  EXPECT_TRUE(says(failure(), "f = 70.0, 70.0"));
  write_text(truth() / "camera.txt", camera);
  EXPECT_EQ(failure(), "");

  fs::rename(truth() / "depth/000011.tiff", truth() / "depth/000012.tiff");
  EXPECT_TRUE(says(failure(), "frame 11 is 000012.tiff instead of 000011.png"));
  fs::remove(truth() / "depth/000012.tiff");
  write_text(truth() / "poses.txt", with_line(12, ""));
  EXPECT_TRUE(says(failure(), "it has 11 frames instead of 12"));
  fs::remove_all(truth());
  EXPECT_TRUE(says(failure(), "there is no folder"));
  fs::create_directory(truth());
  EXPECT_TRUE(says(failure(), "is not a recording"));
}

/// Of a bag, nothing is known before its frames are read.
TEST_F(TruthTest, FramesAreCheckedOneByOneWhereTheRecordingIsNoFolder) {
  write();
  TruthFolder folder(truth().string(), "a.bag");
  const auto refusal = [&](std::size_t index, const DepthFrame& frame) -> std::string {
    try {
      folder.frame_for(index, frame);
    } catch (const BadFrame&) {
      ADD_FAILURE() << "the frame would be skipped";
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  };
  const auto source = open_source(recording().string());
  const RecordedFrame frame = *source->next();
  EXPECT_EQ(refusal(0, frame.view()), "");
  EXPECT_TRUE(says(refusal(1, frame.view()), "frame 1 has the stamp"));
  EXPECT_TRUE(says(refusal(12, frame.view()), "it ends after 12 frames"));
  std::ofstream(truth() / "depth/000000.tiff") << "no image";
  EXPECT_TRUE(says(refusal(0, frame.view()), "000000.tiff cannot be used: the image cannot be read"));
}

TEST_F(TruthTest, ObjectsAreReadAsTheyWereWritten) {
  write(Scene::kPersonWalks, {}, 40);
  const SceneObject expected = scene_things(Scene::kPersonWalks, 40).at(0).object;
  const TruthFolder folder(truth().string(), recording().string());
  ASSERT_EQ(folder.objects().size(), 1u);
  const SceneObject& read = folder.objects()[0];
  EXPECT_EQ(read.name, "person");
  ASSERT_EQ(read.parts.size(), expected.parts.size());
  for (std::size_t i = 0; i < read.parts.size(); ++i) {
    EXPECT_TRUE(read.parts[i].half_size.isApprox(expected.parts[i].half_size));
    EXPECT_TRUE(read.parts[i].T_frame_box.isApprox(expected.parts[i].T_frame_box));
  }
  ASSERT_EQ(read.stands.size(), expected.stands.size());
  for (std::size_t i = 0; i < read.stands.size(); ++i) {
    EXPECT_EQ(read.stands[i].first, expected.stands[i].first);
    EXPECT_EQ(read.stands[i].last, expected.stands[i].last);
    EXPECT_TRUE(read.stands[i].T_world_object.isApprox(expected.stands[i].T_world_object));
  }
}

TEST_F(TruthTest, FaultsOfObjectsGetASentence) {
  write();
  const std::string part = R"({"size": [1, 1, 1], "pose": [0, 0, 0, 0, 0, 0, 1]})",
                    stand = R"({"first": 2, "last": 5, "pose": [0, 0, 0, 0, 0, 0, 1]})";
  const auto refusal = [&](const std::string& parts, const std::string& stands) {
    write_text(truth() / "objects.json", R"({"objects": [{"name": "it", "parts": [)" + parts + R"(], "stands": [)" + stands + "]}]}");
    return failure();
  };
  EXPECT_EQ(refusal(part, stand), "");
  EXPECT_EQ(refusal(part, ""), "") << "an object that is never there";
  EXPECT_TRUE(says(refusal("", stand), "objects.json: the object 'it' has no parts."));
  EXPECT_TRUE(says(refusal(part, stand + "," + stand), "has stands that are not in the order of their frames"));
  EXPECT_TRUE(says(refusal(part, R"({"first": 6, "last": 5, "pose": [0, 0, 0, 0, 0, 0, 1]})"), "first <= last"));
  EXPECT_TRUE(says(refusal(part, R"({"first": -6, "last": 5, "pose": [0, 0, 0, 0, 0, 0, 1]})"), "first <= last"));
  EXPECT_TRUE(says(refusal(part, R"({"first": 2, "last": 5, "pose": [0, 0, 0, 0, 0, 0, 2]})"), "a pose that is none"));
  EXPECT_TRUE(says(refusal(part, R"({"first": 2, "last": 5, "pose": [0, 0, 0, 1]})"), "is not as it must be"));
  EXPECT_TRUE(says(refusal(part, R"({"first": 2, "pose": [0, 0, 0, 0, 0, 0, 1]})"), "is not as it must be"));
  EXPECT_TRUE(says(refusal(R"({"size": [1, 0, 1], "pose": [0, 0, 0, 0, 0, 0, 1]})", stand), "whose size is not above 0"));
  write_text(truth() / "objects.json", "objects: []");
  EXPECT_TRUE(says(failure(), "is not as it must be"));
}

/// The middle of the box in a changing scene is known as it is at the end, whichever frames are used.
TEST_F(TruthTest, TheWorldIsThatOfTheLastFrame) {
  struct Case {
    Scene scene;
    std::size_t frames, stride;
    bool known;
  };
  for (const Case& test :
       {Case{Scene::kBoxAppears, 60, 1, false}, Case{Scene::kBoxAppears, 60, 7, false}, Case{Scene::kBoxAppears, 25, 1, true},
        Case{Scene::kBoxVanishes, 60, 1, true}, Case{Scene::kBoxVanishes, 25, 1, false}, Case{Scene::kBoxReturns, 60, 1, false},
        Case{Scene::kBoxReturns, 39, 1, true}}) {
    for (const fs::path& earlier : {recording(), truth()}) fs::remove_all(earlier);
    write(test.scene, {}, 60);
    Truth judge(working_size(), std::make_shared<TruthFolder>(truth().string(), recording().string()));
    SourceOptions selection;
    selection.last = static_cast<int>(test.frames) - 1;
    selection.stride = static_cast<int>(test.stride);
    const auto source = open_source(recording().string(), selection);
    while (const auto frame = source->next()) judge.add(frame->index, frame->view(), {});
    const SceneObject& box = judge.folder()->objects().at(0);
    const Vector3d middle = box.stands[0].T_world_object * Vector3d(0, 0, 0.15), above = box.stands[0].T_world_object * Vector3d(0, 0, 0.4);
    EXPECT_EQ(judge.exact().known(middle), test.known) << static_cast<int>(test.scene) << ", " << test.frames << " frames";
    EXPECT_TRUE(judge.exact().known(above));
  }
}

}  // namespace
}  // namespace frontier_surfels::replay
