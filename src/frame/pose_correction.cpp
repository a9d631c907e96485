#include "frame/pose_correction.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace frontier_surfels {
namespace {

// References are every second one of the last frames: further apart they see a surface by other pixels, and their errors differ.
constexpr std::size_t kFrames = 15, kEvery = 2;
constexpr double kLeastCosine = 0.94;  // of the angle between the optical axes: from elsewhere surfaces look different

constexpr double kLeastShare = 0.1;  // of the recorded pose, so that errors of the alignment do not add up
constexpr std::size_t kFirstFrames = 8;
constexpr double kFirstShare = 0.3;                // in these
constexpr double kLearning = 0.03;                 // weight of a frame in the running means
constexpr double kPersistence = 2;                 // of the correlation: if it is above a half, the recorded pose counts alone
constexpr double kLittleShift = 0.001;             // [m] if the deviations are not larger, they are rather those of the alignment
constexpr double kLittleTurn = 0.03 * M_PI / 180;  // [rad]
constexpr double kMostShift = 0.03, kMostTurn = 2 * M_PI / 180;  // [m], [rad] if the recorded pose is farther off, it is no jitter

double product(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return a.dot(b) / 3; }

Deviations::Share learned(Deviations::Share share, const Eigen::Vector3d& now, const Eigen::Vector3d& before, double weight,
                          double little) {
  share.variance += weight * (product(now, now) - share.variance);
  share.covariance += weight * (product(now, before) - share.covariance);
  const double small = little * little / (little * little + share.variance);
  share.value = std::clamp(std::max(kPersistence * share.covariance / (share.variance + little * little), small), kLeastShare, 1.0);
  return share;
}

/// The first frames say nothing about jitter: all of them deviate alike from the first one.
Deviations learned(Deviations deviations, const Motion& now, std::size_t frames) {
  if (frames < kFirstFrames) {
    deviations.shift.value = deviations.turn.value = std::max(kFirstShare, 1 / (static_cast<double>(frames) + 1));
  } else {
    const double weight = std::max(kLearning, 1 / static_cast<double>(frames - kFirstFrames + 2));
    const Motion before = deviations.last.value_or(Motion());
    deviations.shift = learned(deviations.shift, now.shift, before.shift, weight, kLittleShift);
    deviations.turn = learned(deviations.turn, now.turn, before.turn, weight, kLittleTurn);
  }
  deviations.last = now;
  return deviations;
}

}  // namespace

std::vector<const ReferenceFrame*> PoseCorrection::History::references(const Eigen::Isometry3d& T_world_camera) const {
  std::vector<const ReferenceFrame*> references;
  for (std::size_t n = 0; n < last.size(); n += kEvery)
    if (last[n].T_world_camera.linear().col(2).dot(T_world_camera.linear().col(2)) > kLeastCosine) references.push_back(&last[n]);
  return references;
}

CorrectedPose PoseCorrection::correct(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera) const {
  const History* history = histories_.find(image.intrinsics);
  if (history == nullptr) return {T_world_camera, {}};
  CorrectedPose recorded = {T_world_camera, history->deviations};
  recorded.deviations.last.reset();
  const auto aligned = align(image, T_world_camera, history->references(T_world_camera), history->frames, config_);
  if (!aligned) return recorded;
  const Eigen::Vector3d centre = aligned->translation();
  const Motion back = motion_between(*aligned, T_world_camera, centre);
  if (back.shift.norm() > kMostShift || back.turn.norm() > kMostTurn) return recorded;
  const Deviations deviations = learned(history->deviations, back, history->frames);
  return {moved(*aligned, {deviations.shift.value * back.shift, deviations.turn.value * back.turn}, centre), deviations};
}

void PoseCorrection::prepare(const WorkingImage& image) {
  if (config_.correct_poses) prepared_ = inverse_depths(image, std::move(prepared_));
}

void PoseCorrection::add(const WorkingImage& image, const CorrectedPose& pose) {
  if (!config_.correct_poses) return;
  if (prepared_.size() != image.depth.size()) prepare(image);  // of another camera: its image must not be taken for this one's
  History& history = histories_.use(image.intrinsics, image.intrinsics);
  std::vector<float> unused;
  if (history.last.size() == kFrames) {
    unused = std::move(history.last.back().inverse_depth);
    history.last.pop_back();
  }
  history.last.push_front({pose.T_world_camera, std::exchange(prepared_, std::move(unused))});
  history.deviations = pose.deviations;
  ++history.frames;
}

}  // namespace frontier_surfels
