#include "frontier_surfels/depth_census.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "frame/depth_pixels.hpp"
#include "frontier_surfels/number_text.hpp"

namespace frontier_surfels {
namespace {

constexpr float kImplausible = 100;  // [m]; no depth camera measures as far, so that such a depth is in another unit

constexpr double kFewInRange = 0.05;  // share of the measured depths

std::string number(double value) { return rounded_text(value, 3); }

void count_depth(float depth, const Config& config, DepthCensus& census) {
  if (std::isnan(depth) || depth <= 0) {
    ++census.missing;
    return;
  }
  census.nearest = std::min(census.nearest, depth);
  if (std::isfinite(depth)) census.farthest = std::max(census.farthest, depth);
  if (std::isinf(depth)) ++census.infinite;
  const bool carves = std::isinf(depth) ? config.carve_no_return : config.carve_beyond_range && depth < kImplausible;
  if (depth < static_cast<float>(config.z_min)) {
    ++census.too_near;
  } else if (depth <= static_cast<float>(config.z_max)) {
    ++census.usable;
  } else if (carves) {
    ++census.usable;
    ++census.carved;
  } else {
    ++census.too_far;
  }
}

template <typename Pixel>
void count_pixels(const DepthImage& image, int decimation, const Config& config, DepthCensus& census) {
  for_each_pixel<Pixel>(image, decimation, [&](Pixel pixel) {
    if (sizeof(Pixel) == 2 && pixel == kSaturated) {
      ++census.saturated;
    } else {
      count_depth(to_metres(pixel, config.depth_unit), config, census);
    }
  });
}

DepthCensus count_every(int decimation, const DepthImage& image, const Config& config) {
  DepthCensus census;
  census.in_metres = image.encoding == DepthImage::Encoding::kMetresF32;
  if (census.in_metres) {
    count_pixels<std::uint32_t>(image, decimation, config, census);
  } else {
    count_pixels<std::uint16_t>(image, decimation, config, census);
  }
  return census;
}

}  // namespace

std::string DepthCensus::reason() const {
  if (usable > 0) return in_working_image > 0 ? "" : "no_agreement";
  if (measured() == 0) return "no_measurement";
  if (saturated == measured()) return "saturated";
  if (too_near > 0 && too_far == 0) return "too_near";
  if (too_far > 0 && too_near == 0) return "too_far";
  return "out_of_range";
}

DepthCensus& DepthCensus::operator+=(const DepthCensus& other) {
  usable += other.usable;
  carved += other.carved;
  missing += other.missing;
  saturated += other.saturated;
  too_near += other.too_near;
  too_far += other.too_far;
  infinite += other.infinite;
  in_metres = other.in_metres;
  nearest = std::min(nearest, other.nearest);
  farthest = std::max(farthest, other.farthest);
  in_working_image += other.in_working_image;
  return *this;
}

std::string depth_range(const Config& config) { return "z_min = " + number(config.z_min) + " m to z_max = " + number(config.z_max) + " m"; }

std::string no_agreement(const Config& config) {
  return "depths from " + depth_range(config) + ", but around no pixel do enough pixels measure the same surface, because their depths " +
         "differ by more than agreement = " + number(config.agreement) +
         ", noise, noise_growth and quantisation allow, or most have none: " +
         "check the camera, set its sensor model (the folder config has some), or set sampling: nearest.";
}

std::string range_and_remedy(const DepthCensus& depths, const Config& config) {
  if (depths.farthest == 0)  // none is finite
    return "of +Inf, which means no surface within the camera's range: go nearer, or set carve_no_return to take them for free space.";
  std::string text = "from " + number(depths.nearest) + " to " + number(depths.farthest) + " m: ";
  if (!depths.in_metres) {
    text += "16-bit images are read in steps of depth_unit = " + number(config.depth_unit) + " m, so correct depth_unit";
  } else if (depths.farthest >= kImplausible) {
    return text + "32-bit images must be in metres, but these look like millimetres, so divide them by 1000, or use 16UC1.";
  } else {
    text += "32-bit images must be in metres, so correct their unit";
  }
  return text + ", or change z_min and z_max.";
}

std::string few_in_range(const DepthCensus& depths, const Config& config) {
  const std::size_t measured = depths.measured() - depths.infinite, in_range = depths.usable - depths.carved;
  if (depths.usable == 0 || measured == 0) return {};
  const double share = static_cast<double>(in_range) / static_cast<double>(measured);
  if (share >= kFewInRange) return {};
  const std::string carves = config.carve_beyond_range ? ", and carve_beyond_range takes those beyond for free space" : "";
  return (in_range == 0 ? "None" : "Only " + number(100 * share) + " %") + " of the measured depths are from " + depth_range(config) +
         carves + (in_range == 0 ? ". All are " : ". All others are ") + range_and_remedy(depths, config);
}

DepthCensus count_depths(const DepthImage& image, const Config& config, std::size_t in_working_image) {
  DepthCensus census = count_every(config.decimation, image, config);
  if (census.measured() == 0 && config.sampling == "mean") census = count_every(1, image, config);
  census.in_working_image = in_working_image;
  return census;
}

}  // namespace frontier_surfels
