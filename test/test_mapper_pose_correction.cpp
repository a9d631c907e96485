/// Poses that jitter are corrected by the images; those that do not, and jumps of them, are left alone.
#include <random>

#include "frame/pose_correction.hpp"
#include "mapper_input.hpp"

namespace frontier_surfels {
namespace {

constexpr double kDegree = M_PI / 180;
constexpr double kVoxels = 1e9;

double shift_between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) { return (a.translation() - b.translation()).norm(); }

double turn_between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::Quaterniond(a.linear()).angularDistance(Eigen::Quaterniond(b.linear()));
}

/// Random shifts and turns, of a standard deviation along and about each axis.
class RandomJitter {
 public:
  RandomJitter(double shift, double turn) : shift_(shift), turn_(turn) {}
  Eigen::Isometry3d operator()(const Eigen::Isometry3d& T) {
    const auto three = [&](double deviation) {
      return Eigen::Vector3d(deviation * normal_(random_), deviation * normal_(random_), deviation * normal_(random_));
    };
    return moved(T, {three(shift_), three(turn_)}, T.translation());
  }

 private:
  double shift_, turn_;
  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
};

WorkingImage working(const replay::RecordedFrame& frame) {
  const Config config = undecimated();
  SamplingRoom room(config);
  return make_working_image(frame.view(), config, kVoxels, room);
}

/// A frame as a reference for others.
ReferenceFrame reference(const replay::RecordedFrame& frame) { return {frame.T_world_camera, inverse_depths(working(frame))}; }

std::vector<const ReferenceFrame*> pointers(const std::vector<ReferenceFrame>& references) {
  std::vector<const ReferenceFrame*> all;
  for (const ReferenceFrame& reference : references) all.push_back(&reference);
  return all;
}

std::vector<ReferenceFrame> references_of(const Frames& frames) {
  std::vector<ReferenceFrame> references;
  for (const auto& frame : frames) references.push_back(reference(frame));
  return references;
}

TEST(PoseAlignment, InverseDepthsAreOfSurfacesAlone) {
  const WorkingImage image = {plain_camera(5, 1, 100), {2, 0, -3, 0.5F, 3}, {}};
  const std::vector<float> expected = {0.5F, 0, 0, 2, 1.0F / 3};
  EXPECT_EQ(inverse_depths(image), expected);
  EXPECT_EQ(inverse_depths(image, std::vector<float>(9, 7.0F)), expected);
}

TEST(PoseAlignment, AMotionLeadsFromOnePoseToTheOther) {
  RandomJitter jitter(0.3, 0.4);
  for (int n = 0; n < 50; ++n) {
    const Eigen::Isometry3d from = jitter(Eigen::Isometry3d::Identity()), to = jitter(from);
    const Eigen::Vector3d centre(1, -2, 0.5 * n);
    EXPECT_TRUE(moved(from, motion_between(from, to, centre), centre).isApprox(to, 1e-12));
  }
}

TEST(PoseAlignment, ASmallTurnIsARotationVector) {
  const Eigen::Vector3d turn(0.001, -0.002, 0.003);
  const Eigen::Matrix3d R = moved(Eigen::Isometry3d::Identity(), {Eigen::Vector3d::Zero(), turn}, Eigen::Vector3d(3, 4, 5)).linear();
  EXPECT_TRUE(R.isApprox(Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix(), 1e-7));
}

/// The room has surfaces in all directions, and its depths have no noise. Images of half the size say half as much.
TEST(PoseAlignment, FindsTheTruePoseInARoom) {
  for (const int width : {160, 80, 81, 320}) {
    const Frames frames = orbit_frames(replay::synthetic_camera(width, width * 3 / 4), 9);
    const std::vector<ReferenceFrame> references = references_of({frames.begin(), frames.begin() + 8});
    const Eigen::Isometry3d truth = frames[8].T_world_camera;
    RandomJitter jitter(0.003, 0.2 * kDegree);
    constexpr std::size_t kTries = 40;
    double shift = 0, turn = 0;
    for (std::size_t number = 0; number < kTries; ++number) {
      const auto aligned = align(working(frames[8]), jitter(truth), pointers(references), number, undecimated());
      ASSERT_TRUE(aligned);
      shift += shift_between(*aligned, truth) / kTries;
      turn += turn_between(*aligned, truth) / kTries;
    }
    EXPECT_LT(shift, width < 100 ? 0.0025 : 0.0015) << width;         // 4.8 mm before
    EXPECT_LT(turn, (width < 100 ? 0.16 : 0.08) * kDegree) << width;  // 0.32 degrees before
  }
}

/// Along a wall, and about its normal, surfaces do not say where the camera is: there the recorded pose counts.
TEST(PoseAlignment, AWallCorrectsItsDistanceAlone) {
  const replay::RecordedFrame wall = plane_frame(working_camera(), 2);
  const std::vector<ReferenceFrame> references(8, reference(wall));
  Eigen::Isometry3d recorded = wall.T_world_camera;
  recorded.translation() += Eigen::Vector3d(0.006, -0.005, 0.007);
  const auto aligned = align(working(wall), recorded, pointers(references), 0, undecimated());
  ASSERT_TRUE(aligned);
  EXPECT_NEAR(aligned->translation().z(), 0, 0.0005);
  EXPECT_NEAR(aligned->translation().x(), 0.006, 0.0005);
  EXPECT_NEAR(aligned->translation().y(), -0.005, 0.0005);
  EXPECT_LT(turn_between(*aligned, recorded), 0.02 * kDegree);
}

TEST(PoseAlignment, WhatStandsElsewhereDoesNotPull) {
  replay::RecordedFrame wall = plane_frame(working_camera(), 2);
  const std::vector<ReferenceFrame> references(8, reference(wall));
  wall.depth(cv::Rect(0, 0, 60, 120)) = 1.9;  // a third of the image is nearer now
  const auto aligned = align(working(wall), wall.T_world_camera, pointers(references), 0, undecimated());
  ASSERT_TRUE(aligned);
  EXPECT_LT(shift_between(*aligned, wall.T_world_camera), 0.001);
}

TEST(PoseAlignment, ThereIsNoneWithoutSurfacesInCommon) {
  const replay::RecordedFrame wall = plane_frame(working_camera(), 2), empty = plane_frame(working_camera(), 0),
                              farther = plane_frame(working_camera(), 2.5), small = plane_frame(plain_camera(1, 1, 100), 2);
  const std::vector<ReferenceFrame> walls(8, reference(wall)), none(8, reference(empty)), smalls(8, reference(small));
  const Eigen::Isometry3d T = wall.T_world_camera, away = look_along(Eigen::Vector3d(9, 0, 0), Eigen::Vector3d(0, 1, 0));
  const Config config = undecimated();
  EXPECT_FALSE(align(working(wall), T, {}, 0, config));
  EXPECT_FALSE(align(working(wall), T, pointers(none), 0, config));
  EXPECT_FALSE(align(working(wall), away, pointers(walls), 0, config));
  EXPECT_FALSE(align(working(empty), T, pointers(walls), 0, config));
  EXPECT_FALSE(align(working(farther), T, pointers(walls), 0, config));
  EXPECT_FALSE(align(working(small), T, pointers(smalls), 0, config));
}

/// What a PoseCorrection makes of recorded poses.
std::vector<Eigen::Isometry3d> corrected(PoseCorrection& correction, const Frames& frames, const std::vector<Eigen::Isometry3d>& recorded) {
  std::vector<Eigen::Isometry3d> poses;
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const WorkingImage image = working(frames[n]);
    const CorrectedPose pose = correction.correct(image, recorded[n]);
    correction.prepare(image);
    correction.add(image, pose);
    poses.push_back(pose.T_world_camera);
  }
  return poses;
}

std::vector<Eigen::Isometry3d> poses_of(const Frames& frames) {
  std::vector<Eigen::Isometry3d> poses;
  for (const auto& frame : frames) poses.push_back(frame.T_world_camera);
  return poses;
}

/// Root of the mean of squares, from frame `first` on.
template <typename Difference>
double rms(const std::vector<Eigen::Isometry3d>& a, const std::vector<Eigen::Isometry3d>& b, std::size_t first, Difference difference) {
  double squares = 0;
  for (std::size_t n = first; n < a.size(); ++n) squares += std::pow(difference(a[n], b[n]), 2);
  return std::sqrt(squares / static_cast<double>(a.size() - first));
}

TEST(PoseCorrection, JitterIsTakenOut) {
  const Frames frames = orbit_frames(working_camera(), 60);
  const std::vector<Eigen::Isometry3d> truth = poses_of(frames);
  std::vector<Eigen::Isometry3d> recorded = truth;
  RandomJitter jitter(0.003, 0.2 * kDegree);
  for (Eigen::Isometry3d& pose : recorded) pose = jitter(pose);
  PoseCorrection correction(undecimated());
  const std::vector<Eigen::Isometry3d> poses = corrected(correction, frames, recorded);
  EXPECT_LT(rms(poses, truth, 10, shift_between), 0.55 * rms(recorded, truth, 10, shift_between));
  EXPECT_LT(rms(poses, truth, 10, turn_between), 0.55 * rms(recorded, truth, 10, turn_between));
}

TEST(PoseCorrection, ExactPosesStayAsTheyAre) {
  const Frames frames = orbit_frames(working_camera(), 60);
  PoseCorrection correction(undecimated());
  const std::vector<Eigen::Isometry3d> poses = corrected(correction, frames, poses_of(frames));
  EXPECT_TRUE(poses.front().matrix() == frames.front().T_world_camera.matrix());
  EXPECT_LT(rms(poses, poses_of(frames), 0, shift_between), 0.0005);
  EXPECT_LT(rms(poses, poses_of(frames), 0, turn_between), 0.02 * kDegree);
}

/// As when a localisation finds the robot again: the map must be where it says.
TEST(PoseCorrection, AJumpIsFollowedAtOnceAndASmallOneSoon) {
  const Frames frames = orbit_frames(working_camera(), 60);
  for (const double jump : {0.1, 0.02}) {
    std::vector<Eigen::Isometry3d> recorded = poses_of(frames);
    for (std::size_t n = 20; n < recorded.size(); ++n) recorded[n].translation() += jump * Eigen::Vector3d(0.6, 0, 0.8);
    PoseCorrection correction(undecimated());
    const std::vector<Eigen::Isometry3d> poses = corrected(correction, frames, recorded);
    const std::size_t followed = jump > 0.05 ? 20 : 40;
    for (std::size_t n = followed; n < recorded.size(); ++n)
      EXPECT_LT(shift_between(poses[n], recorded[n]), 0.005) << jump << ", frame " << n;
  }
}

/// Errors of the correction do not add up to a drift of the map.
TEST(PoseCorrection, TheMapStaysWhereThePosesAreOnTheAverage) {
  const replay::RecordedFrame wall = plane_frame(working_camera(), 2);
  const Frames frames(100, wall);
  std::vector<Eigen::Isometry3d> recorded = poses_of(frames);
  for (std::size_t n = 0; n < recorded.size(); ++n) recorded[n].translation().z() += n % 2 == 0 ? 0.004 : -0.004;
  PoseCorrection correction(undecimated());
  const std::vector<Eigen::Isometry3d> poses = corrected(correction, frames, recorded);
  for (std::size_t n = 30; n < poses.size(); ++n) EXPECT_LT(std::abs(poses[n].translation().z()), 0.0025);
}

TEST(PoseCorrection, CamerasHaveLastFramesOfTheirOwn) {
  const Frames frames = orbit_frames(working_camera(), 30);
  std::vector<Eigen::Isometry3d> recorded = poses_of(frames);
  RandomJitter jitter(0.003, 0.2 * kDegree);
  for (Eigen::Isometry3d& pose : recorded) pose = jitter(pose);
  PoseCorrection alone(undecimated()), shared(undecimated());
  const std::vector<Eigen::Isometry3d> wanted = corrected(alone, frames, recorded);
  const WorkingImage other = working(plane_frame(coarse_camera(), 1));
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const WorkingImage image = working(frames[n]);
    const CorrectedPose pose = shared.correct(image, recorded[n]);
    EXPECT_TRUE(pose.T_world_camera.matrix() == wanted[n].matrix());
    shared.prepare(image);
    shared.add(image, pose);
    shared.prepare(other);
    shared.add(other, shared.correct(other, jitter(recorded[n])));
  }
}

TEST(PoseCorrection, ForgetsWhenCleared) {
  const Frames frames = orbit_frames(working_camera(), 10);
  PoseCorrection correction(undecimated());
  corrected(correction, frames, poses_of(frames));
  correction.clear();
  const Eigen::Isometry3d recorded = RandomJitter(0.003, 0.2 * kDegree)(frames[9].T_world_camera);
  EXPECT_TRUE(correction.correct(working(frames[9]), recorded).T_world_camera.matrix() == recorded.matrix());
}

/// Of the whole mapper, by the frames as they were.
TEST(MapperPoseCorrection, AMapOfJitteringPosesIsNearTheTruth) {
  const Frames truth = orbit_frames(working_camera(), 60);
  Frames recorded = truth;
  RandomJitter jitter(0.003, 0.2 * kDegree);
  for (auto& frame : recorded) frame.T_world_camera = jitter(frame.T_world_camera);
  Config with = undecimated(), without = undecimated();
  without.correct_poses = false;
  scoring::ExactTest test(with);
  for (const auto& frame : truth) test.add(frame.view());
  const scoring::ExactScore corrected = test.score(map_of(recorded, with)), plain = test.score(map_of(recorded, without));
  EXPECT_LT(corrected.miss_2cm, plain.miss_2cm / 4);
  EXPECT_LT(corrected.fdr_2cm, plain.fdr_2cm / 4);
}

TEST(MapperPoseCorrection, TheReportHasThePose) {
  const Frames frames = orbit_frames(coarse_camera(), 8);
  for (const bool correct : {true, false}) {
    Config config = undecimated();
    config.correct_poses = correct;
    Mapper mapper(config);
    RandomJitter jitter(0.003, 0.2 * kDegree);
    bool all_as_recorded = true;
    for (replay::RecordedFrame frame : frames) {
      frame.T_world_camera = jitter(frame.T_world_camera);
      const Report report = mapper.integrate(frame.view());
      EXPECT_LT(shift_between(report.T_world_camera, frame.T_world_camera), 0.03);
      all_as_recorded = all_as_recorded && report.T_world_camera.matrix() == frame.T_world_camera.matrix();
    }
    EXPECT_EQ(all_as_recorded, !correct);
  }
}

}  // namespace
}  // namespace frontier_surfels
