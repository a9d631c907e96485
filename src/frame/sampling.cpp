#include "frame/sampling.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "frame/depth_pixels.hpp"
#include "frame/row_bands.hpp"

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

DepthPlanes::DepthPlanes(const DepthImage& image, const Config& config, int margin)
    : decimation_(config.decimation), margin_(margin), stride_((image.width + decimation_ - 1) / decimation_ + 2) {
  depth_.assign(static_cast<std::size_t>(image.height + 2 * margin_) * decimation_ * stride_, 0.0F);
  in_row_bands(image.height, config.threads, [&](int first, int last) {
    if (image.encoding == DepthImage::Encoding::kStepsU16)
      read<std::uint16_t>(image, config, first, last);
    else
      read<std::uint32_t>(image, config, first, last);
  });
}

/// All depths far beyond z_max are alike.
template <typename Pixel>
void DepthPlanes::read(const DepthImage& image, const Config& config, int first_row, int last_row) {
  const float infinity = std::numeric_limits<float>::infinity(), no_return = config.carve_no_return ? infinity : 0,
              far = static_cast<float>(2 * config.z_max);
  std::vector<float> of_row(image.width);
  for (int row = first_row; row < last_row; ++row) {
    const auto* pixels = static_cast<const std::uint8_t*>(image.data) + row * image.step;
    for (int column = 0; column < image.width; ++column) {
      const float raw = to_metres(pixel_at<Pixel>(pixels + column * sizeof(Pixel), image.swap_bytes), config.depth_unit),
                  finite = std::min(raw, far);
      of_row[column] = raw > 0 ? (raw == infinity ? no_return : finite) : 0;
    }
    for (int first = 0; first < decimation_; ++first) {
      float* to = &depth_[(static_cast<std::size_t>(row + margin_) * decimation_ + first) * stride_ + 1];
      for (int column = first; column < image.width; column += decimation_) *to++ = of_row[column];
    }
  }
}

const float* DepthPlanes::every(int column, int row) const {
  const int plane = (column + decimation_) % decimation_, first = column < 0 ? 0 : 1;
  return &depth_[(static_cast<std::size_t>(row + margin_) * decimation_ + plane) * stride_ + first];
}

float DepthPlanes::at(int column, int row) const {
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

/// Of each block of a row: limits of the depths that agree, their sum and their number, and the numbers of the other pixels.
struct Sampling::Row {
  explicit Row(int width) : lowest(width), highest(width), sum(width), agree(width), nearer(width), farther(width) {}
  std::vector<float> lowest, highest, sum;
  std::vector<int> agree, nearer, farther;
};

/// With the middle pixels as pivots. The loop over the blocks of the row is the inner one, so that the compiler makes vectors of it.
void Sampling::sample_row(const DepthPlanes& planes, int t, Row& row) const {
  const int width = static_cast<int>(row.sum.size());
  const float* pivots = planes.every(0, config_.decimation * t);
  for (int s = 0; s < width; ++s) {
    row.lowest[s] = lowest(pivots[s]);
    row.highest[s] = highest(pivots[s]);
    row.sum[s] = 0;
    row.agree[s] = row.nearer[s] = row.farther[s] = 0;
  }
  const float *low = row.lowest.data(), *high = row.highest.data();
  float* __restrict__ sum = row.sum.data();
  int* __restrict__ agree = row.agree.data(), * __restrict__ nearer = row.nearer.data(), * __restrict__ farther = row.farther.data();
  for (int dy = -radius_; dy <= radius_; ++dy)
    for (int dx = -radius_; dx <= radius_; ++dx) {
      const float* depth = planes.every(dx, config_.decimation * t + dy);
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

SampledDepth Sampling::sample(const DepthPlanes& planes, int width, int height) const {
  const std::size_t count = static_cast<std::size_t>(width) * height;
  std::vector<float> means(count);
  SampledDepth sampled = {{}, std::vector<float>(count), std::vector<std::uint8_t>(count)};
  in_row_bands(height, config_.threads, [&](int first, int last) { sample_rows(planes, width, first, last, means.data(), sampled); });
  sampled.depth = in_range(means, width, height);
  return sampled;
}

/// Rows first ... last - 1 of the working image. @param means  of all rows, before in_range()
void Sampling::sample_rows(const DepthPlanes& planes, int width, int first, int last, float* means, SampledDepth& sampled) const {
  const int edge = 2 * radius_ + 1;
  Row row(width);
  for (int t = first; t < last; ++t) {
    sample_row(planes, t, row);
    const float* middle = planes.every(0, config_.decimation * t);
    for (int s = 0; s < width; ++s) {
      const std::size_t n = static_cast<std::size_t>(t) * width + s;
      const int agree = row.agree[s], nearer = row.nearer[s], farther = row.farther[s];
      float pivot = middle[s], mean = row.sum[s] / static_cast<float>(std::max(agree, 1));
      if (std::isinf(pivot)) {
        mean = has_no_return(planes, s, t) ? pivot : 0;
      } else if (agree < least_ || (nearer > agree && farther > agree)) {
        mean = agree + nearer + farther < least_ ? 0 : fill(planes, s, t, &pivot);
      }
      means[n] = mean;
      sampled.whole[n] = agree == edge * edge ? 1 : 0;
      sampled.pivots[n] = mean > 0 && std::isfinite(mean) ? pivot : 0;
    }
  }
}

/// For a block whose middle pixel is lost, or measures what few others do. @return 0: no measurement
float Sampling::fill(const DepthPlanes& planes, int s, int t, float* pivot) const {
  int nearest = std::numeric_limits<int>::max();
  *pivot = 0;
  for_each_pixel_of(planes, s, t, [&](float depth, int dx, int dy) {
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
  for_each_pixel_of(planes, s, t, [&](float depth, int dx, int dy) {
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

bool Sampling::has_no_return(const DepthPlanes& planes, int s, int t) const {
  int count = 0;
  for_each_pixel_of(planes, s, t, [&](float depth, int, int) { count += std::isinf(depth) ? 1 : 0; });
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
