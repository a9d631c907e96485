#include "synthetic/synthetic_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "frame/depth_pixels.hpp"

namespace frontier_surfels::replay {
namespace {

constexpr double kDisparityStep = 2.85e-3;     // [1/m]; Khoshelham and Elberink, Sensors 2012: depth resolution 2.85e-3 z^2
constexpr double kDisparityDeviation = 0.5;    // [step]
constexpr double kGrazingCosine = 0.17;        // 80 degrees
constexpr double kJump = 0.04;                 // smallest relative step of depth between neighbours that counts as an edge
constexpr double kLostAtEdges = 0.7;           // share of pixels
constexpr double kSmallestBlob = 2.0 / 640.0;  // radius over image width
constexpr double kLargestBlob = 16.0 / 640.0;
constexpr double kNearestOutlier = 0.5, kFarthestOutlier = 3;  // [m] the default range of the mapper, so that all outliers count

// Each kind of error has random numbers of its own, so that one does not change another.
constexpr std::uint64_t kNoiseStream = 0, kOutlierStream = 1, kFlyingStream = 2, kPoseStream = 3;

/// The random numbers of one kind of error in one frame. Seed, frame and kind are mixed (splitmix64), because similar seeds would give
/// similar first numbers.
cv::RNG random_numbers(std::uint64_t seed, int index, std::uint64_t stream) {
  std::uint64_t z = seed * 0x9e3779b97f4a7c15u + static_cast<std::uint64_t>(index) + 1 + (stream << 32);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return cv::RNG(z ^ (z >> 31));
}

void add_noise(cv::Mat& depth, cv::RNG& random) {
  std::for_each(depth.begin<float>(), depth.end<float>(), [&](float& z) {
    if (!(z > 0)) return;
    const double steps = std::round(1 / (z * kDisparityStep) + random.gaussian(kDisparityDeviation));
    z = steps >= 1 ? static_cast<float>(1 / (steps * kDisparityStep)) : 0.0f;
  });
}

bool is_jump(float a, float b) { return std::abs(a - b) > kJump * std::min(a, b); }

/// The smallest and the largest depth of a pixel and the four beside it, without those that have none.
std::pair<float, float> depths_around(const cv::Mat& depth, int row, int column) {
  float near = depth.at<float>(row, column), far = near;
  const auto add = [&](int other_row, int other_column) {
    if (other_row < 0 || other_row >= depth.rows || other_column < 0 || other_column >= depth.cols) return;
    const float z = depth.at<float>(other_row, other_column);
    if (!(z > 0)) return;
    near = std::min(near, z);
    far = std::max(far, z);
  };
  add(row - 1, column);
  add(row + 1, column);
  add(row, column - 1);
  add(row, column + 1);
  return {near, far};
}

/// Mixes foreground and background in the pixels beside an edge, with random weights.
void mix_edges(cv::Mat& depth, cv::RNG& random) {
  const cv::Mat before = depth.clone();
  for (int row = 0; row < depth.rows; ++row) {
    for (int column = 0; column < depth.cols; ++column) {
      const auto [near, far] = depths_around(before, row, column);
      if (!(near > 0) || !is_jump(near, far)) continue;
      depth.at<float>(row, column) = near + static_cast<float>(random.uniform(0.0, 1.0)) * (far - near);
    }
  }
}

void add_outliers(cv::Mat& depth, double share, cv::RNG& random) {
  std::for_each(depth.begin<float>(), depth.end<float>(), [&](float& z) {
    if (random.uniform(0.0, 1.0) < share) z = static_cast<float>(random.uniform(kNearestOutlier, kFarthestOutlier));
  });
}

void drop_edges(cv::Mat& depth, const cv::Mat& cos_incidence, cv::RNG& random) {
  const cv::Mat before = depth.clone();
  const auto jumps_at = [&](int row, int column) {
    const float z = before.at<float>(row, column);
    return (row > 0 && is_jump(z, before.at<float>(row - 1, column))) ||
           (row + 1 < before.rows && is_jump(z, before.at<float>(row + 1, column))) ||
           (column > 0 && is_jump(z, before.at<float>(row, column - 1))) ||
           (column + 1 < before.cols && is_jump(z, before.at<float>(row, column + 1)));
  };
  for (int row = 0; row < depth.rows; ++row) {
    for (int column = 0; column < depth.cols; ++column) {
      const bool weak = cos_incidence.at<float>(row, column) < kGrazingCosine || jumps_at(row, column);
      if (weak && random.uniform(0.0, 1.0) < kLostAtEdges) depth.at<float>(row, column) = 0;
    }
  }
}

/// Drops discs of random size until `share` of the image is covered.
void drop_blobs(cv::Mat& depth, double share, cv::RNG& random) {
  cv::Mat lost = cv::Mat::zeros(depth.size(), CV_8UC1);
  const double wanted = std::min(share, 1.0) * static_cast<double>(depth.total());
  for (double covered = 0; covered < wanted;) {
    const double radius = std::max(0.5, random.uniform(kSmallestBlob, kLargestBlob) * depth.cols);
    const double u = random.uniform(0.0, static_cast<double>(depth.cols)), v = random.uniform(0.0, static_cast<double>(depth.rows));
    for (int row = std::max(0, static_cast<int>(v - radius)); row < std::min(depth.rows, static_cast<int>(v + radius) + 1); ++row) {
      for (int column = std::max(0, static_cast<int>(u - radius)); column < std::min(depth.cols, static_cast<int>(u + radius) + 1);
           ++column) {
        if (covered >= wanted || lost.at<std::uint8_t>(row, column) || std::hypot(column - u, row - v) > radius) continue;
        lost.at<std::uint8_t>(row, column) = 1;
        ++covered;
      }
    }
  }
  depth.setTo(0, lost);
}

}  // namespace

cv::Mat measure(const cv::Mat& depth, const cv::Mat& cos_incidence, const SensorModel& sensor, int index) {
  cv::Mat measured = depth.clone();
  if (sensor.flying) {
    cv::RNG random = random_numbers(sensor.seed, index, kFlyingStream);
    mix_edges(measured, random);
  }
  cv::RNG random = random_numbers(sensor.seed, index, kNoiseStream);
  if (sensor.noise) add_noise(measured, random);
  if (sensor.dropouts > 0) {
    drop_edges(measured, cos_incidence, random);
    drop_blobs(measured, sensor.dropouts, random);
  }
  if (sensor.outliers > 0) {
    cv::RNG outliers = random_numbers(sensor.seed, index, kOutlierStream);
    add_outliers(measured, sensor.outliers, outliers);
  }
  cv::Mat millimetres(depth.size(), CV_16UC1);
  std::transform(measured.begin<float>(), measured.end<float>(), millimetres.begin<std::uint16_t>(),
                 [](float z) { return z < 65.535f ? static_cast<std::uint16_t>(std::lround(z * 1000)) : 0; });
  return millimetres;
}

SensedFrame spoilt(const RecordedFrame& frame, const SensorModel& sensor, int index) {
  SensedFrame sensed{frame, frame};
  sensed.ideal.index = sensed.measured.index = static_cast<std::size_t>(index);
  if (frame.depth.type() == CV_16UC1) {
    sensed.ideal.depth = cv::Mat(frame.depth.size(), CV_32FC1);
    std::transform(frame.depth.begin<std::uint16_t>(), frame.depth.end<std::uint16_t>(), sensed.ideal.depth.begin<float>(),
                   [](std::uint16_t millimetres) { return to_metres(millimetres, 1e-3); });
  }
  sensed.measured.depth = measure(sensed.ideal.depth, cv::Mat::ones(frame.depth.size(), CV_32FC1), sensor, index);
  sensed.measured.T_world_camera = tracked(frame.T_world_camera, sensor, index);
  return sensed;
}

Eigen::Isometry3d tracked(const Eigen::Isometry3d& T_world_camera, const SensorModel& sensor, int index) {
  if (sensor.position_noise == 0 && sensor.rotation_noise == 0) return T_world_camera;
  cv::RNG random = random_numbers(sensor.seed, index, kPoseStream);
  const auto gaussian = [&](double deviation) {
    const double x = random.gaussian(deviation), y = random.gaussian(deviation);
    return Eigen::Vector3d(x, y, random.gaussian(deviation));
  };
  const Eigen::Vector3d shift = gaussian(sensor.position_noise), turn = gaussian(sensor.rotation_noise);
  Eigen::Isometry3d tracked = T_world_camera;
  tracked.translation() += shift;
  if (turn.norm() > 0) tracked.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  return tracked;
}

}  // namespace frontier_surfels::replay
