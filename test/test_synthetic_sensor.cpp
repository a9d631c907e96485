/// The errors of the synthetic sensor and of its poses are as stated, and independent of each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "synthetic/synthetic_room.hpp"
#include "synthetic/synthetic_sensor.hpp"

namespace frontier_surfels::replay {
namespace {

constexpr int kFrames = 60;

SensorModel with(const std::function<void(SensorModel&)>& change) {
  SensorModel sensor;
  change(sensor);
  return sensor;
}

SensedFrame sense(const SensorModel& sensor, int index = 3) {
  static const Room room;
  return room.sense(index, kFrames, synthetic_camera(320, 240), sensor, CameraPath::kOrbit);
}

/// Calls visit(row, column, ideal depth [m], measured depth [m]) for each pixel.
void for_each_pixel(const SensedFrame& frame, const std::function<void(int, int, double, double)>& visit) {
  for (int row = 0; row < frame.ideal.depth.rows; ++row) {
    for (int column = 0; column < frame.ideal.depth.cols; ++column)
      visit(row, column, frame.ideal.depth.at<float>(row, column), frame.measured.depth.at<std::uint16_t>(row, column) * 1e-3);
  }
}

TEST(Sensor, TheIdealFrameHasNoErrors) {
  const Room room;
  const SensedFrame frame = sense(with([](SensorModel& sensor) {
    sensor.noise = sensor.flying = true;
    sensor.outliers = 0.2;
    sensor.dropouts = 0.1;
    sensor.position_noise = sensor.rotation_noise = 0.05;
  }));
  const RecordedFrame exact = room.render(3, kFrames, synthetic_camera(320, 240));
  EXPECT_EQ(cv::norm(frame.ideal.depth, exact.depth, cv::NORM_INF), 0);
  EXPECT_TRUE(frame.ideal.T_world_camera.isApprox(exact.T_world_camera, 1e-15));
  EXPECT_EQ(frame.ideal.index, 3u);
  EXPECT_TRUE(cv::checkRange(frame.ideal.depth, true, nullptr, 0.1, 20)) << "neither NaN nor holes";
}

TEST(Sensor, OutliersHaveTheirShareAndAnEvenDistribution) {
  constexpr double kShare = 0.02;
  std::vector<double> outliers;
  std::size_t pixels = 0;
  for (int index = 0; index < 10; ++index) {
    for_each_pixel(sense(with([](SensorModel& sensor) { sensor.outliers = kShare; }), index), [&](int, int, double z, double measured) {
      ++pixels;
      if (std::abs(measured - z) > 0.6e-3) outliers.push_back(measured);
    });
  }
  const double expected = kShare * static_cast<double>(pixels);
  EXPECT_NEAR(static_cast<double>(outliers.size()), expected, 5 * std::sqrt(expected));
  std::sort(outliers.begin(), outliers.end());
  EXPECT_GE(outliers.front(), 0.4995);
  EXPECT_LE(outliers.back(), 3.0005);
  for (const double quantile : {0.1, 0.25, 0.5, 0.75, 0.9})
    EXPECT_NEAR(outliers[static_cast<std::size_t>(quantile * static_cast<double>(outliers.size()))], 0.5 + 2.5 * quantile, 0.06);
}

/// Smallest and largest ideal depth of a pixel and the four beside it.
std::pair<double, double> range_around(const cv::Mat& depth, int row, int column) {
  double near = depth.at<float>(row, column), far = near;
  for (const auto& [down, right] : {std::pair(-1, 0), {1, 0}, {0, -1}, {0, 1}}) {
    const int other_row = std::clamp(row + down, 0, depth.rows - 1), other_column = std::clamp(column + right, 0, depth.cols - 1);
    near = std::min<double>(near, depth.at<float>(other_row, other_column));
    far = std::max<double>(far, depth.at<float>(other_row, other_column));
  }
  return {near, far};
}

TEST(Sensor, FlyingPixelsLieBetweenForegroundAndBackground) {
  double sum_of_weights = 0;
  int flying = 0;
  const SensedFrame frame = sense(with([](SensorModel& sensor) { sensor.flying = true; }));
  for_each_pixel(frame, [&](int row, int column, double z, double measured) {
    const auto [near, far] = range_around(frame.ideal.depth, row, column);
    if (far - near <= 0.04 * near) {  // no edge
      EXPECT_NEAR(measured, z, 0.6e-3);
      return;
    }
    EXPECT_GE(measured, near - 0.6e-3);
    EXPECT_LE(measured, far + 0.6e-3);
    sum_of_weights += (measured - near) / (far - near);
    ++flying;
  });
  EXPECT_GT(flying, 500);
  EXPECT_LT(flying, 0.1 * 320 * 240);
  EXPECT_NEAR(sum_of_weights / flying, 0.5, 0.05);
}

TEST(Sensor, PoseNoiseHasItsDeviationAboutEachAxis) {
  constexpr double kPosition = 0.003, kRotation = 0.2 * M_PI / 180;
  const SensorModel sensor = with([](SensorModel& changed) {
    changed.position_noise = kPosition;
    changed.rotation_noise = kRotation;
  });
  const Eigen::Isometry3d pose = camera_pose(CameraPath::kOrbit, 5, kFrames);
  Eigen::Vector3d shift_sum = Eigen::Vector3d::Zero(), shift_squares = shift_sum, turn_sum = shift_sum, turn_squares = shift_sum;
  constexpr int kSamples = 2000;
  for (int index = 0; index < kSamples; ++index) {
    const Eigen::Isometry3d noisy = tracked(pose, sensor, index);
    EXPECT_TRUE(noisy.linear().isUnitary(1e-12));
    const Eigen::AngleAxisd turn(pose.linear().transpose() * noisy.linear());
    const Eigen::Vector3d shift = noisy.translation() - pose.translation(), axes = turn.angle() * turn.axis();
    shift_sum += shift;
    turn_sum += axes;
    shift_squares += shift.cwiseAbs2();
    turn_squares += axes.cwiseAbs2();
  }
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(shift_sum[axis] / kSamples, 0, 5 * kPosition / std::sqrt(kSamples));
    EXPECT_NEAR(turn_sum[axis] / kSamples, 0, 5 * kRotation / std::sqrt(kSamples));
    EXPECT_NEAR(std::sqrt(shift_squares[axis] / kSamples), kPosition, 0.1 * kPosition);
    EXPECT_NEAR(std::sqrt(turn_squares[axis] / kSamples), kRotation, 0.1 * kRotation);
  }
}

TEST(Sensor, ImagesAreThoseOfTheTruePoses) {
  const SensedFrame exact = sense({}), noisy = sense(with([](SensorModel&sensor) { sensor.position_noise = 0.05; }));
  EXPECT_EQ(cv::norm(exact.measured.depth, noisy.measured.depth, cv::NORM_INF), 0);
  EXPECT_GT((noisy.measured.T_world_camera.translation() - noisy.ideal.T_world_camera.translation()).norm(), 1e-3);
  EXPECT_TRUE(exact.measured.T_world_camera.isApprox(exact.ideal.T_world_camera, 1e-15));
}

/// One kind of error draws no random numbers of another: where there is no outlier, the noise is the same.
TEST(Sensor, ErrorsAreIndependentOfEachOther) {
  const auto noise = [](SensorModel& sensor) { sensor.noise = true; };
  const SensedFrame noisy = sense(with(noise)), both = sense(with([&](SensorModel&sensor) {
                                                  noise(sensor);
                                                  sensor.outliers = 0.1;
                                                  sensor.position_noise = 0.01;
                                                }));
  const cv::Mat same = noisy.measured.depth == both.measured.depth;
  EXPECT_NEAR(cv::countNonZero(same) / static_cast<double>(same.total()), 0.9, 0.01);
}

TEST(Sensor, TheSeedDecidesAllErrors) {
  const auto all = [](SensorModel& sensor) {
    sensor.flying = true;
    sensor.outliers = 0.01;
    sensor.position_noise = 0.01;
    sensor.rotation_noise = 0.01;
  };
  const SensedFrame first = sense(with(all)), again = sense(with(all)), other = sense(with([&](SensorModel&sensor) {
                                                                          all(sensor);
                                                                          sensor.seed = 2;
                                                                        }));
  EXPECT_EQ(cv::norm(first.measured.depth, again.measured.depth, cv::NORM_INF), 0);
  EXPECT_TRUE(first.measured.T_world_camera.isApprox(again.measured.T_world_camera, 0));
  EXPECT_GT(cv::norm(first.measured.depth, other.measured.depth, cv::NORM_INF), 0);
  EXPECT_FALSE(first.measured.T_world_camera.isApprox(other.measured.T_world_camera, 1e-6));
}

TEST(Sensor, SpoilsRecordedFramesAndKeepsThemAsTruth) {
  RecordedFrame recorded;
  recorded.depth = cv::Mat(40, 60, CV_16UC1, cv::Scalar(1234));
  recorded.depth.colRange(30, 60).setTo(2500);
  recorded.depth.rowRange(0, 2).setTo(0);
  recorded.depth.row(3).setTo(65535);
  recorded.intrinsics = synthetic_camera(60, 40);
  recorded.T_world_camera = Eigen::Isometry3d::Identity();
  const SensedFrame same = spoilt(recorded, {}, 7);
  EXPECT_EQ(same.ideal.index, 7u);
  EXPECT_EQ(same.ideal.depth.at<float>(10, 10), 1.234F);
  EXPECT_EQ(cv::countNonZero(same.ideal.depth.rowRange(0, 2)) + cv::countNonZero(same.ideal.depth.row(3)), 0);
  EXPECT_EQ(cv::norm(same.measured.depth.rowRange(4, 40), recorded.depth.rowRange(4, 40), cv::NORM_INF), 0);

  const SensedFrame flying = spoilt(recorded, with([](SensorModel& sensor) { sensor.flying = true; }), 0);
  const cv::Mat changed = flying.measured.depth.rowRange(5, 40) != recorded.depth.rowRange(5, 40);
  EXPECT_EQ(cv::countNonZero(changed.colRange(0, 29)) + cv::countNonZero(changed.colRange(31, 60)), 0)
      << "a pixel without depth is no edge";
  EXPECT_GT(cv::countNonZero(changed.colRange(29, 31)), 60);
}

}  // namespace
}  // namespace frontier_surfels::replay
