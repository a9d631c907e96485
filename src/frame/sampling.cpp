#include "frame/sampling.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "frame/depth_pixels.hpp"
#include "frame/wide_vectors.hpp"

namespace frontier_surfels {
namespace {

constexpr double kLeastShare = 0.16;  // of a block's pixels that must agree: 4 of 25
constexpr int kMostOthers = 8;        // so many pixels that agree for each other one, where a block is filled
constexpr float kSigmas = 3;          // of noise within which pixels of one surface are

/// The side of a line on which a pixel lies, in the line's own two bits. @param across  distance from the line, with its sign
unsigned side_of_line(int line, int across) { return (across < 0 ? 1U : across > 0 ? 2U : 0U) << (2 * line); }

/// Sides of the four lines through the middle pixel on which the pixel (dx, dy) from it lies.
unsigned sides_of(int dx, int dy) {
  return side_of_line(0, dx) | side_of_line(1, dy) | side_of_line(2, dx + dy) | side_of_line(3, dx - dy);
}
constexpr unsigned kAllSides = 0xff;

/// Deals the pixels of a row out to four planes, one to each in turn. @return number of the pixels dealt
int deal_to_four(const float* row, int width, int stride, float* planes) {
  float* __restrict__ first = planes;
  float* __restrict__ second = first + stride;
  float* __restrict__ third = second + stride;
  float* __restrict__ fourth = third + stride;
  for (int s = 0; s < width / 4; ++s) {
    first[s] = row[4 * s];
    second[s] = row[4 * s + 1];
    third[s] = row[4 * s + 2];
    fourth[s] = row[4 * s + 3];
  }
  return width / 4 * 4;
}

/// As deal_to_four().
int deal_to_two(const float* row, int width, int stride, float* planes) {
  float* __restrict__ first = planes;
  float* __restrict__ second = first + stride;
  for (int s = 0; s < width / 2; ++s) {
    first[s] = row[2 * s];
    second[s] = row[2 * s + 1];
  }
  return width / 2 * 2;
}

/// Counts kColumns pixels of each block, which lie side by side. depth[n][s] is the n-th of block s; see BandSampler for the other arrays.
template <std::size_t kColumns>
void count_columns(const std::array<const float*, kColumns>& depth, int width, const float* lowest, const float* highest,
                   float* __restrict__ sum, int* __restrict__ agree, int* __restrict__ farther, int* __restrict__ measured) {
  for (int s = 0; s < width; ++s) {
    const float low = lowest[s], high = highest[s];
    float total = sum[s];
    std::array<int, kColumns> agrees, is_far, is_measured;
    for (std::size_t n = 0; n < kColumns; ++n) {
      const float d = depth[n][s];
      is_far[n] = d > high ? 1 : 0;
      agrees[n] = 1 - (is_far[n] | (d < low ? 1 : 0));
      is_measured[n] = d > 0 ? 1 : 0;
      total += agrees[n] != 0 ? d : 0;
    }
    sum[s] = total;
    agree[s] += std::accumulate(agrees.begin(), agrees.end(), 0);
    farther[s] += std::accumulate(is_far.begin(), is_far.end(), 0);
    measured[s] += std::accumulate(is_measured.begin(), is_measured.end(), 0);
  }
}

WIDE_VECTORS void interpret(const DepthMeaning meaning, const std::vector<float>& means, std::vector<float>& depth) {
  for (std::size_t n = 0; n < means.size(); ++n) depth[n] = meaning(means[n]);
}

/// Is any value not farther than `reach` from `middle`?
WIDE_VECTORS bool any_near(const float* values, int count, float middle, float reach) {
  int any = 0;
  for (int n = 0; n < count; ++n) any |= std::abs(values[n] - middle) <= reach ? 1 : 0;
  return any != 0;
}

}  // namespace

DepthRows::DepthRows(const DepthImage& image, const Config& config, int margin)
    : image_(image),
      depth_unit_(config.depth_unit),
      no_return_(config.carve_no_return ? std::numeric_limits<float>::infinity() : 0),
      far_(static_cast<float>(2 * config.z_max)),
      decimation_(config.decimation),
      margin_(margin),
      rows_(2 * margin + 1),
      stride_((image.width + decimation_ - 1) / decimation_ + 2),
      next_(-margin),
      of_row_(image.width),
      depth_(static_cast<std::size_t>(rows_) * decimation_ * stride_) {}

void DepthRows::move_to(int t) {
  const int middle = decimation_ * t;
  for (next_ = std::max(next_, middle - margin_); next_ <= middle + margin_; ++next_) {
    float* planes = &depth_[first_of(next_)];
    if (next_ < 0 || next_ >= image_.height)
      std::fill(planes, planes + static_cast<std::ptrdiff_t>(decimation_) * stride_, 0.0F);
    else
      read(next_, planes);
  }
}

/// All depths far beyond z_max are alike. The blank pixels beside the image stay as they are. The common decimations have loops of their
/// own, of which the compiler makes vectors.
WIDE_VECTORS void DepthRows::read(int row, float* planes) {
  const auto of_float = [no_return = no_return_, far = far_](float raw) {
    const float depth = raw == std::numeric_limits<float>::infinity() ? no_return : std::min(raw, far);
    return raw > 0 ? depth : 0;
  };
  const auto of_steps = [far = far_](float raw) { return std::min(raw, far); };  // never negative or infinite
  if (image_.encoding == DepthImage::Encoding::kStepsU16)
    read_row<std::uint16_t>(image_, row, depth_unit_, of_steps, of_row_.data());
  else
    read_row<std::uint32_t>(image_, row, depth_unit_, of_float, of_row_.data());
  float* first = planes + 1;
  int column = 0;
  if (decimation_ == 2) column = deal_to_two(of_row_.data(), image_.width, stride_, first);
  if (decimation_ == 4) column = deal_to_four(of_row_.data(), image_.width, stride_, first);
  for (int s = column / decimation_; column < image_.width; ++s)
    for (int plane = 0; plane < decimation_ && column < image_.width; ++plane, ++column) first[plane * stride_ + s] = of_row_[column];
}

Sampling::Sampling(const Config& config)
    : config_(config),
      radius_(config.decimation / 2),
      least_(std::max(1, static_cast<int>(std::ceil(kLeastShare * (2 * radius_ + 1) * (2 * radius_ + 1))))),
      agreement_(static_cast<float>(config.agreement)),
      constant_(static_cast<float>(kSigmas * config.noise)),
      growth_(static_cast<float>(kSigmas * config.noise_growth + config.quantisation)) {}

BandSampler::BandSampler(const Sampling& sampling, const DepthImage& image, int width)
    : sampling_(sampling),
      rows_(image, sampling.config_, sampling.radius_),
      lowest_(width),
      highest_(width),
      sum_(width),
      agree_(width),
      farther_(width),
      measured_(width),
      is_unclear_(width),
      is_odd_(width) {}

/// With the middle pixels as pivots.
WIDE_VECTORS void BandSampler::begin_count(const float* pivots) {
  const int width = static_cast<int>(sum_.size());
  const Sampling sampling = sampling_;  // a copy, which the loop does not change
  float* __restrict__ lowest = lowest_.data(), * __restrict__ highest = highest_.data();
  for (int s = 0; s < width; ++s) {
    lowest[s] = sampling.lowest(pivots[s]);
    highest[s] = sampling.highest(pivots[s]);
  }
  std::fill(sum_.begin(), sum_.end(), 0.0F);
  for (std::vector<int>* counts : {&agree_, &farther_, &measured_}) std::fill(counts->begin(), counts->end(), 0);
}

/// The loops over the blocks of the row are the inner ones, so that the compiler makes vectors of them, but several pixels of each block
/// are counted at once: sums that stay in registers need not be fetched.
WIDE_VECTORS void BandSampler::count(int t) {
  const int width = static_cast<int>(sum_.size()), radius = sampling_.radius_;
  const auto add = [&](const auto& depth) {
    count_columns(depth, width, lowest_.data(), highest_.data(), sum_.data(), agree_.data(), farther_.data(), measured_.data());
  };
  for (int row = sampling_.config_.decimation * t - radius, last = row + 2 * radius; row <= last; ++row) {
    const auto every = [&, planes = rows_.planes_of(row)](int dx) { return planes + rows_.offset_of(dx); };
    int dx = -radius;
    for (; dx + 4 <= radius; dx += 5)
      add(std::array<const float*, 5>{every(dx), every(dx + 1), every(dx + 2), every(dx + 3), every(dx + 4)});
    for (; dx + 2 <= radius; dx += 3) add(std::array<const float*, 3>{every(dx), every(dx + 1), every(dx + 2)});
    for (; dx <= radius; ++dx) add(std::array<const float*, 1>{every(dx)});
  }
}

/// What the counts say of the blocks of a row: of all but the odd ones, of which the pixels must be looked at again. In two loops, because
/// the compiler makes vectors of none that does it all.
WIDE_VECTORS void BandSampler::take_means(const float* pivots, float* __restrict__ means, float* __restrict__ pivots_used,
                                          int* __restrict__ whole) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const int width = static_cast<int>(sum_.size()), edge = 2 * sampling_.radius_ + 1, all = edge * edge, least = sampling_.least_;
  const float* sum = sum_.data();
  const int *agree = agree_.data(), *farther = farther_.data(), *measured = measured_.data();
  int* __restrict__ is_odd = is_odd_.data(), * __restrict__ is_unclear = is_unclear_.data();
  for (int s = 0; s < width; ++s) {
    const int nearer = measured[s] - agree[s] - farther[s], no_return = pivots[s] == kInfinity ? 1 : 0;
    const int is_slope = std::min(nearer, farther[s]) > agree[s] ? 1 : 0, is_little = agree[s] < least ? 1 : 0;
    is_unclear[s] = is_slope | is_little;
    is_odd[s] = no_return | (is_unclear[s] & (measured[s] >= least ? 1 : 0));
    whole[s] = (agree[s] == all ? 1 : 0) & (1 - no_return);  // blank pixels beside the image agree with +Inf, too
  }
  for (int s = 0; s < width; ++s) {
    const float pivot = pivots[s], mean = sum[s] / static_cast<float>(std::max(agree[s], 1));
    means[s] = is_unclear[s] != 0 ? 0 : mean;
    pivots_used[s] = means[s] > 0 ? pivot : 0;
  }
}

void BandSampler::sample_row(int t, SampledDepth& sampled) {
  rows_.move_to(t);
  const float* pivots = rows_.every(0, sampling_.config_.decimation * t);
  const int width = static_cast<int>(sum_.size());
  const std::size_t first = static_cast<std::size_t>(t) * width;
  begin_count(pivots);
  count(t);
  take_means(pivots, &sampled.means[first], &sampled.pivots[first], &sampled.whole[first]);
  for (int s = 0; s < width; ++s) {
    if (is_odd_[s] == 0) continue;
    float pivot = pivots[s], &mean = sampled.means[first + s];
    if (std::isinf(pivot)) {
      mean = sampling_.has_no_return(rows_, s, t) ? pivot : 0;
    } else {
      mean = sampling_.fill(rows_, s, t, &pivot);
    }
    sampled.pivots[first + s] = mean > 0 && std::isfinite(mean) ? pivot : 0;
  }
}

/// For a block whose middle pixel is lost, or measures what few others do. Without branches, which a processor could not foresee.
/// @return 0: no measurement
float Sampling::fill(const DepthRows& rows, int s, int t, float* pivot) const {
  int nearest = std::numeric_limits<int>::max();
  float found = 0;
  for_each_pixel_of(rows, s, t, [&](float depth, int dx, int dy) {
    const int distance = dx * dx + dy * dy, is_nearer = (depth != 0 ? 1 : 0) & (distance != 0 ? 1 : 0) & (distance < nearest ? 1 : 0);
    found = is_nearer != 0 ? depth : found;
    nearest = is_nearer != 0 ? distance : nearest;
  });
  *pivot = found;
  if (found == 0 || std::isinf(found)) return 0;
  const float low = lowest(found), high = highest(found);
  float sum = 0;
  int agree = 0, measured = 0;
  unsigned sides = 0;
  for_each_pixel_of(rows, s, t, [&](float depth, int dx, int dy) {
    const int agrees = (depth >= low ? 1 : 0) & (depth <= high ? 1 : 0);
    sum += agrees != 0 ? depth : 0;
    sides |= agrees != 0 ? sides_of(dx, dy) : 0U;
    agree += agrees;
    measured += depth != 0 ? 1 : 0;
  });
  return agree >= least_ && agree >= kMostOthers * (measured - agree) && sides == kAllSides ? sum / static_cast<float>(agree) : 0;
}

bool Sampling::has_no_return(const DepthRows& rows, int s, int t) const {
  int count = 0;
  for_each_pixel_of(rows, s, t, [&](float depth, int, int) { count += std::isinf(depth) ? 1 : 0; });
  return count >= least_;
}

/// What depths mean. Whether one near z_max is within the range is decided by the mean with its neighbours: by noise, single pixels would
/// be lost there, and leave rays of unknown space.
std::vector<float> Sampling::in_range(const std::vector<float>& means, int width, int height) const {
  const float z_max = static_cast<float>(config_.z_max), near_limit = tolerance(z_max), beyond = std::nextafter(z_max, 2 * z_max);
  const DepthMeaning meaning(config_);
  std::vector<float> depth(means.size());
  interpret(meaning, means, depth);
  for (int t = 0; t < height; ++t) {
    if (!any_near(&means[static_cast<std::size_t>(t) * width], width, z_max, near_limit)) continue;
    for (int s = 0; s < width; ++s) {
      const std::size_t n = static_cast<std::size_t>(t) * width + s;
      const float mean = means[n];
      if (!(std::abs(mean - z_max) <= near_limit)) continue;
      float sum = 0, count = 0;
      for (int row = std::max(t - 1, 0); row <= std::min(t + 1, height - 1); ++row)
        for (int column = std::max(s - 1, 0); column <= std::min(s + 1, width - 1); ++column) {
          const float other = means[static_cast<std::size_t>(row) * width + column];
          if (!(std::abs(other - mean) <= near_limit)) continue;
          sum += other;
          count += 1;
        }
      depth[n] = meaning(sum / count > z_max ? beyond : std::min(mean, z_max));
    }
  }
  return depth;
}

}  // namespace frontier_surfels
