#include "frame/sampling.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "frame/depth_pixels.hpp"

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

}  // namespace

float interpret(float d, const Config& config) {
  const float z_max = static_cast<float>(config.z_max);
  if (std::isnan(d) || d < static_cast<float>(config.z_min)) return 0;
  if (d <= z_max) return d;
  return (std::isinf(d) ? config.carve_no_return : config.carve_beyond_range) ? -z_max : 0;
}

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
    float* planes = planes_of(next_);
    if (next_ < 0 || next_ >= image_.height)
      std::fill(planes, planes + static_cast<std::ptrdiff_t>(decimation_) * stride_, 0.0F);
    else if (image_.encoding == DepthImage::Encoding::kStepsU16)
      read<std::uint16_t>(next_, planes);
    else
      read<std::uint32_t>(next_, planes);
  }
}

/// All depths far beyond z_max are alike. The blank pixels beside the image stay as they are.
template <typename Pixel>
void DepthRows::read(int row, float* planes) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const auto* pixels = static_cast<const std::uint8_t*>(image_.data) + row * image_.step;
  for (int column = 0; column < image_.width; ++column) {
    const float raw = to_metres(pixel_at<Pixel>(pixels + column * sizeof(Pixel), image_.swap_bytes), depth_unit_),
                finite = std::min(raw, far_);
    of_row_[column] = raw > 0 ? (raw == kInfinity ? no_return_ : finite) : 0;
  }
  for (int first = 0; first < decimation_; ++first) {
    float* to = &planes[first * stride_ + 1];
    for (int column = first; column < image_.width; column += decimation_) *to++ = of_row_[column];
  }
}

const float* DepthRows::every(int column, int row) const {
  const int plane = (column + decimation_) % decimation_, first = column < 0 ? 0 : 1;
  return &depth_[(static_cast<std::size_t>((row + margin_) % rows_) * decimation_ + plane) * stride_ + first];
}

float DepthRows::at(int column, int row) const {
  return column < 0 ? *every(column, row) : every(column % decimation_, row)[column / decimation_];
}

Sampling::Sampling(const Config& config)
    : config_(config),
      radius_(config.decimation / 2),
      least_(std::max(1, static_cast<int>(std::ceil(kLeastShare * (2 * radius_ + 1) * (2 * radius_ + 1))))),
      agreement_(static_cast<float>(config.agreement)),
      constant_(static_cast<float>(kSigmas * config.noise)),
      growth_(static_cast<float>(kSigmas * config.noise_growth + config.quantisation)) {}

float Sampling::tolerance(float depth) const { return std::max(agreement_ * depth, constant_ + growth_ * depth * depth); }
float Sampling::lowest(float pivot) const { return std::max(pivot - tolerance(pivot), std::numeric_limits<float>::min()); }

BandSampler::BandSampler(const Sampling& sampling, const DepthImage& image, int width)
    : sampling_(sampling),
      rows_(image, sampling.config_, sampling.radius_),
      lowest_(width),
      highest_(width),
      sum_(width),
      agree_(width),
      nearer_(width),
      farther_(width) {}

/// With the middle pixels as pivots. The loop over the blocks of the row is the inner one, so that the compiler makes vectors of it.
void BandSampler::count(int t) {
  const int width = static_cast<int>(sum_.size()), radius = sampling_.radius_, row = sampling_.config_.decimation * t;
  const float* pivots = rows_.every(0, row);
  for (int s = 0; s < width; ++s) {
    lowest_[s] = sampling_.lowest(pivots[s]);
    highest_[s] = sampling_.highest(pivots[s]);
    sum_[s] = 0;
    agree_[s] = nearer_[s] = farther_[s] = 0;
  }
  const float *low = lowest_.data(), *high = highest_.data();
  float* __restrict__ sum = sum_.data();
  int* __restrict__ agree = agree_.data(), * __restrict__ nearer = nearer_.data(), * __restrict__ farther = farther_.data();
  for (int dy = -radius; dy <= radius; ++dy)
    for (int dx = -radius; dx <= radius; ++dx) {
      const float* depth = rows_.every(dx, row + dy);
      for (int s = 0; s < width; ++s) {
        const float d = depth[s];
        const int is_near = d < low[s] ? 1 : 0, is_far = d > high[s] ? 1 : 0, measured = d > 0 ? 1 : 0;
        const int agrees = 1 - (is_near | is_far);
        sum[s] += agrees != 0 ? d : 0;
        agree[s] += agrees;
        nearer[s] += is_near & measured;
        farther[s] += is_far;
      }
    }
}

void BandSampler::sample_row(int t, SampledDepth& sampled) {
  rows_.move_to(t);
  count(t);
  const int width = static_cast<int>(sum_.size()), edge = 2 * sampling_.radius_ + 1, least = sampling_.least_;
  const float* middle = rows_.every(0, sampling_.config_.decimation * t);
  for (int s = 0; s < width; ++s) {
    const std::size_t n = static_cast<std::size_t>(t) * width + s;
    const int agree = agree_[s], nearer = nearer_[s], farther = farther_[s];
    float pivot = middle[s], mean = sum_[s] / static_cast<float>(std::max(agree, 1));
    if (std::isinf(pivot)) {
      mean = sampling_.has_no_return(rows_, s, t) ? pivot : 0;
    } else if (agree < least || (nearer > agree && farther > agree)) {
      mean = agree + nearer + farther < least ? 0 : sampling_.fill(rows_, s, t, &pivot);
    }
    sampled.means[n] = mean;
    sampled.whole[n] = agree == edge * edge && !std::isinf(pivot) ? 1 : 0;  // with +Inf also the blank pixels beside the image agree
    sampled.pivots[n] = mean > 0 && std::isfinite(mean) ? pivot : 0;
  }
}

/// For a block whose middle pixel is lost, or measures what few others do. @return 0: no measurement
float Sampling::fill(const DepthRows& rows, int s, int t, float* pivot) const {
  int nearest = std::numeric_limits<int>::max();
  *pivot = 0;
  for_each_pixel_of(rows, s, t, [&](float depth, int dx, int dy) {
    const int distance = dx * dx + dy * dy;
    if (depth == 0 || distance == 0 || distance >= nearest) return;
    *pivot = depth;
    nearest = distance;
  });
  if (*pivot == 0 || std::isinf(*pivot)) return 0;
  const float low = lowest(*pivot), high = highest(*pivot);
  float sum = 0;
  int agree = 0, others = 0;
  unsigned sides = 0;
  for_each_pixel_of(rows, s, t, [&](float depth, int dx, int dy) {
    if (depth == 0) return;
    if (depth < low || depth > high) {
      ++others;
      return;
    }
    sum += depth;
    ++agree;
    sides |= sides_of(dx, dy);
  });
  return agree >= least_ && agree >= kMostOthers * others && sides == kAllSides ? sum / static_cast<float>(agree) : 0;
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
  std::vector<float> depth;
  depth.reserve(means.size());
  for (int t = 0; t < height; ++t)
    for (int s = 0; s < width; ++s) {
      const float mean = means[static_cast<std::size_t>(t) * width + s];
      if (!(std::abs(mean - z_max) <= near_limit)) {
        depth.push_back(interpret(mean, config_));
        continue;
      }
      float sum = 0, count = 0;
      for (int row = std::max(t - 1, 0); row <= std::min(t + 1, height - 1); ++row)
        for (int column = std::max(s - 1, 0); column <= std::min(s + 1, width - 1); ++column) {
          const float other = means[static_cast<std::size_t>(row) * width + column];
          if (!(std::abs(other - mean) <= near_limit)) continue;
          sum += other;
          count += 1;
        }
      depth.push_back(interpret(sum / count > z_max ? beyond : std::min(mean, z_max), config_));
    }
  return depth;
}

}  // namespace frontier_surfels
