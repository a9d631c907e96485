#include "scoring/mean_depths.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace frontier_surfels::scoring {
namespace {

/// A pixel of a block that has measured something; dx, dy: from the middle.
struct Pixel {
  int dx, dy;
  float depth;
};
using Pixels = std::vector<Pixel>;

float tolerance_at(float depth, const DepthReading& reading) {
  const auto constant = static_cast<float>(3.0F * reading.noise),
             growth = static_cast<float>(3.0F * reading.noise_growth + reading.quantisation);
  return std::max(static_cast<float>(reading.agreement) * depth, constant + growth * depth * depth);
}

Pixels measured_around(const RawDepths& raw, int column, int row, int radius, const DepthReading& reading) {
  Pixels measured;
  for (int dy = -radius; dy <= radius; ++dy)
    for (int dx = -radius; dx <= radius; ++dx) {
      const int x = column + dx, y = row + dy;
      if (x < 0 || y < 0 || x >= raw.width || y >= raw.height) continue;
      const float depth = raw.depth[static_cast<std::size_t>(y) * raw.width + x];
      if (!(depth > 0) || (std::isinf(depth) && !reading.carve_no_return)) continue;
      const bool is_far = std::isfinite(depth) && depth > 2 * reading.z_max;  // such depths are alike
      measured.push_back({dx, dy, is_far ? static_cast<float>(2 * reading.z_max) : depth});
    }
  return measured;
}

/// Pixels whose depth is that of `pivot`.
Pixels agreeing(const Pixels& measured, float pivot, const DepthReading& reading) {
  const float tolerance = tolerance_at(pivot, reading);
  Pixels agree;
  std::copy_if(measured.begin(), measured.end(), std::back_inserter(agree),
               [&](const Pixel& p) { return p.depth >= pivot - tolerance && p.depth <= pivot + tolerance; });
  return agree;
}

/// @return 0 if there is no surface at `pivot`
float mean_at(const Pixels& measured, float pivot, double least, const DepthReading& reading) {
  const Pixels agree = agreeing(measured, pivot, reading);
  const float tolerance = tolerance_at(pivot, reading);
  const auto nearer = static_cast<std::size_t>(
      std::count_if(measured.begin(), measured.end(), [&](const Pixel& p) { return p.depth < pivot - tolerance; }));
  const std::size_t farther = measured.size() - agree.size() - nearer;
  const bool on_slope = nearer > agree.size() && farther > agree.size();
  if (static_cast<double>(agree.size()) < least || on_slope) return 0;
  float sum = 0;
  for (const Pixel& p : agree) sum += p.depth;
  return sum / static_cast<float>(agree.size());
}

/// Are there pixels on both sides of each of four lines through the middle?
bool surround(const Pixels& pixels) {
  for (const auto& [x, y] : {std::pair(1, 0), std::pair(0, 1), std::pair(1, 1), std::pair(1, -1)})
    for (const int side : {-1, 1}) {
      const bool any =
          std::any_of(pixels.begin(), pixels.end(), [x = x, y = y, side](const Pixel& p) { return side * (x * p.dx + y * p.dy) > 0; });
      if (!any) return false;
    }
  return true;
}

float filled(const Pixels& measured, double least, const DepthReading& reading) {
  Pixels others;
  std::copy_if(measured.begin(), measured.end(), std::back_inserter(others), [](const Pixel& p) { return p.dx != 0 || p.dy != 0; });
  const auto nearest = std::min_element(
      others.begin(), others.end(), [](const Pixel& a, const Pixel& b) { return a.dx * a.dx + a.dy * a.dy < b.dx * b.dx + b.dy * b.dy; });
  if (nearest == others.end() || std::isinf(nearest->depth)) return 0;
  const float mean = mean_at(measured, nearest->depth, least, reading);
  const Pixels agree = agreeing(measured, nearest->depth, reading);
  const bool few_others = 8 * (measured.size() - agree.size()) <= agree.size();
  return few_others && surround(agree) ? mean : 0;
}

/// What the block around (column, row) has measured, whatever the range. @return +Inf no return, 0 no measurement
float measured_by_block(const RawDepths& raw, int column, int row, const DepthReading& reading) {
  const int radius = reading.decimation / 2, edge = 2 * radius + 1;
  const double least = std::ceil(0.16 * edge * edge);
  const Pixels measured = measured_around(raw, column, row, radius, reading);
  const auto middle = std::find_if(measured.begin(), measured.end(), [](const Pixel& p) { return p.dx == 0 && p.dy == 0; });
  if (middle != measured.end() && std::isinf(middle->depth)) {
    const auto no_return = std::count_if(measured.begin(), measured.end(), [](const Pixel& p) { return std::isinf(p.depth); });
    return static_cast<double>(no_return) >= least ? middle->depth : 0;
  }
  const float mean = middle == measured.end() ? 0 : mean_at(measured, middle->depth, least, reading);
  return mean > 0 ? mean : filled(measured, least, reading);
}

}  // namespace

std::vector<float> mean_depths(const RawDepths& raw, const DepthReading& reading) {
  const int n = reading.decimation, width = raw.width / n, height = raw.height / n;
  std::vector<float> means;
  for (int t = 0; t < height; ++t)
    for (int s = 0; s < width; ++s) means.push_back(measured_by_block(raw, n * s, n * t, reading));

  // Near the end of the range the neighbours have a say
  const auto z_max = static_cast<float>(reading.z_max), near_limit = tolerance_at(z_max, reading);
  std::vector<float> depth;
  for (int t = 0; t < height; ++t)
    for (int s = 0; s < width; ++s) {
      const float mean = means[static_cast<std::size_t>(t) * width + s];
      if (!(std::abs(mean - z_max) <= near_limit)) {
        depth.push_back(meaning(mean, reading));
        continue;
      }
      float sum = 0, count = 0;
      for (int row = t - 1; row <= t + 1; ++row)
        for (int column = s - 1; column <= s + 1; ++column) {
          if (row < 0 || column < 0 || row >= height || column >= width) continue;
          const float other = means[static_cast<std::size_t>(row) * width + column];
          if (!(std::abs(other - mean) <= near_limit)) continue;
          sum += other;
          count += 1;
        }
      const bool beyond = sum / count > z_max;
      depth.push_back(beyond ? (reading.carve_beyond_range ? -z_max : 0) : meaning(std::min(mean, z_max), reading));
    }
  return depth;
}

}  // namespace frontier_surfels::scoring
