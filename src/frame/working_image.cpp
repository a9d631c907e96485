#include "frame/working_image.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "frame/depth_pixels.hpp"
#include "frame/sampling.hpp"
#include "frame/view_grid.hpp"
#include "frame/wide_vectors.hpp"
#include "frontier_surfels/number_text.hpp"

namespace frontier_surfels {
namespace {

std::string size_text(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

void check_depth(const DepthImage& image, const Config& config) {
  const std::size_t pixel = image.encoding == DepthImage::Encoding::kStepsU16 ? 2 : 4;
  if (image.width < config.decimation || image.height < config.decimation)
    throw BadFrame("The depth image of " + size_text(image.width, image.height) + " pixels is smaller than one pixel after decimation by " +
                   std::to_string(config.decimation) + "; lower decimation.");
  if (image.data == nullptr) throw BadFrame("The depth image has no data.");
  if (image.step < image.width * pixel)
    throw BadFrame("The depth image's rows of " + std::to_string(image.step) + " bytes are shorter than its " +
                   std::to_string(image.width) + " pixels.");
}

void check_intrinsics(const Intrinsics& k, const DepthImage& image) {
  constexpr double kMaxPrincipalPoint = 1e6, kMinFocalLength = 1e-3;  // [pixel]; beyond these floats overflow
  if (!(k.fx >= kMinFocalLength && k.fy >= kMinFocalLength && std::isfinite(k.fx) && std::isfinite(k.fy)))
    throw BadFrame("The focal lengths " + fixed_text(k.fx, 6) + ", " + fixed_text(k.fy, 6) +
                   " must be positive: is the camera calibrated, and its camera_info published?");
  if (!(std::abs(k.cx) <= kMaxPrincipalPoint && std::abs(k.cy) <= kMaxPrincipalPoint))
    throw BadFrame("The principal point " + fixed_text(k.cx, 6) + ", " + fixed_text(k.cy, 6) +
                   " of the camera is not a number or far outside the image: is its camera_info right?");
  if (k.width != image.width || k.height != image.height)
    throw BadFrame("The intrinsics are for " + size_text(k.width, k.height) + " pixels and the depth image has " +
                   size_text(image.width, image.height) + ".");
}

void check_pose(const Eigen::Isometry3d& T_world_camera) {
  if (!T_world_camera.matrix().allFinite()) throw BadFrame("The camera's pose is missing or not finite.");
  const Eigen::Matrix3d R = T_world_camera.linear();
  constexpr double kTolerance = 1e-3;
  if (!(R.transpose() * R).isIdentity(kTolerance) || R.determinant() < 0)
    throw BadFrame("The camera's orientation is not a rotation: normalise its quaternion.");
  if (T_world_camera.translation().cwiseAbs().maxCoeff() > 1e5)
    throw BadFrame("The camera is more than 100 km from the world's origin, where a float no longer resolves a voxel; move the origin.");
}

void check_color(const ColorImage& color, const DepthImage& depth) {
  if (color.width != depth.width || color.height != depth.height)
    throw BadFrame("The colour image of " + size_text(color.width, color.height) + " pixels is not registered to the depth image of " +
                   size_text(depth.width, depth.height) + ".");
  if (color.data == nullptr || (color.channels != 3 && color.channels != 4) ||
      color.step < static_cast<std::size_t>(color.width) * color.channels)
    throw BadFrame("The colour image must have data, 3 or 4 bytes per pixel, and rows that are long enough for its width.");
}

/// Depths of every decimation-th pixel in both directions, as DepthMeaning says.
/// @param depth  [height / decimation][width / decimation], of which rows first ... last - 1 are written
WIDE_VECTORS void read_depth(const DepthImage& image, const Config& config, int first, int last, float* depth) {
  const int step = config.decimation, width = image.width / step;
  const DepthMeaning meaning(config);
  std::vector<float> of_row(step == 1 ? 0 : image.width);
  for (int t = first; t < last; ++t) {
    float* row = depth + static_cast<std::ptrdiff_t>(t) * width;
    float* to = step == 1 ? row : of_row.data();
    if (image.encoding == DepthImage::Encoding::kStepsU16)
      read_row<std::uint16_t>(image, t * step, config.depth_unit, meaning, to);
    else
      read_row<std::uint32_t>(image, t * step, config.depth_unit, meaning, to);
    if (step == 1) continue;
    for (int s = 0; s < width; ++s) row[s] = of_row[static_cast<std::size_t>(s) * step];
  }
}

using Rgb = std::array<std::uint32_t, 3>;

/// @param channels  of a pixel, or their sums over several
template <typename Channel>
Rgb read_rgb(const Channel* channels, ColorImage::Order order) {
  const int red = order == ColorImage::Order::kRgb ? 0 : 2;
  return {channels[red], channels[1], channels[2 - red]};
}

Rgb read_color(const ColorImage& image, int column, int row) {
  return read_rgb(image.data + row * image.step + column * image.channels, image.order);
}

void add(Rgb& sum, const Rgb& rgb) { std::transform(sum.begin(), sum.end(), rgb.begin(), sum.begin(), std::plus<>()); }

std::uint32_t packed(const Rgb& rgb) { return rgb[0] | rgb[1] << 8 | rgb[2] << 16; }

/// Divides by a number of pixels of a block, by a multiplication: a processor's division takes ten times as long.
class Divisor {
 public:
  explicit Divisor(int pixels) : count_(static_cast<std::uint32_t>(pixels)), factor_((std::uint64_t{1} << kBits) / count_ + 1) {}

  /// sum / pixels, rounded. Exact for sums of bytes: the quotient is too large by less than sum / 2^40, which is less than 1 / pixels.
  std::uint32_t mean(std::uint32_t sum) const { return static_cast<std::uint32_t>((sum + count_ / 2) * factor_ >> kBits); }

 private:
  static constexpr int kBits = 40;
  std::uint32_t count_;
  std::uint64_t factor_;
};

std::uint32_t packed_mean(const Rgb& sum, const Divisor& pixels) {
  return packed({pixels.mean(sum[0]), pixels.mean(sum[1]), pixels.mean(sum[2])});
}

/// Colours of blocks: the mean of the pixels that measure the block's surface.
class MeanColors {
 public:
  MeanColors(const ColorImage& color, const DepthRows& rows, const Sampling& sampling, const Config& config)
      : color_(color),
        rows_(rows),
        sampling_(sampling),
        decimation_(config.decimation),
        whole_block_((2 * sampling.radius() + 1) * (2 * sampling.radius() + 1)),
        of_columns_(color.width * color.channels) {}

  /// @param t       row of the blocks, of which `rows` has the pixels
  /// @param colors  of the row
  void fill_row(int t, const SampledDepth& sampled, std::uint32_t* colors, int width) {
    const int row = decimation_ * t, radius = sampling_.radius();
    add_rows(std::max(row - radius, 0), std::min(row + radius, color_.height - 1));
    for (int s = 0; s < width; ++s) {
      const std::size_t n = static_cast<std::size_t>(t) * width + s;
      colors[s] = sampled.whole[n] ? of_whole_block(decimation_ * s) : of_some(s, t, sampled.pivots[n]);
    }
  }

 private:
  void add_rows(int first, int last) {
    std::fill(of_columns_.begin(), of_columns_.end(), 0);
    for (int row = first; row <= last; ++row) {
      const std::uint8_t* bytes = color_.data + row * color_.step;
      for (std::size_t n = 0; n < of_columns_.size(); ++n) of_columns_[n] = static_cast<std::uint16_t>(of_columns_[n] + bytes[n]);
    }
  }

  std::uint32_t of_whole_block(int column) const {
    const int radius = sampling_.radius();
    Rgb sum = {0, 0, 0};
    for (int n = column - radius; n <= column + radius; ++n)
      add(sum, read_rgb(&of_columns_[static_cast<std::size_t>(n) * color_.channels], color_.order));
    return packed_mean(sum, whole_block_);
  }

  /// The middle pixel's if nothing was measured.
  std::uint32_t of_some(int s, int t, float pivot) const {
    const int column = decimation_ * s, row = decimation_ * t;
    if (pivot == 0) return packed(read_color(color_, column, row));
    const float lowest = sampling_.lowest(pivot), highest = sampling_.highest(pivot);
    Rgb sum = {0, 0, 0};
    int count = 0;
    sampling_.for_each_pixel_of(rows_, s, t, [&](float depth, int dx, int dy) {
      if (depth < lowest || depth > highest) return;
      add(sum, read_color(color_, column + dx, row + dy));
      ++count;
    });
    return packed_mean(sum, Divisor(count));
  }

  const ColorImage& color_;
  const DepthRows& rows_;
  const Sampling& sampling_;
  int decimation_;
  Divisor whole_block_;                    ///< number of its pixels
  std::vector<std::uint16_t> of_columns_;  ///< sums of the bytes of a block's rows, at most 65 of them
};

/// The paper's: one pixel of each block.
void sample_nearest(const DepthFrame& frame, const Config& config, RowWorkers& workers, WorkingImage& image) {
  const int width = image.intrinsics.width, height = image.intrinsics.height;
  image.depth.resize(static_cast<std::size_t>(width) * height);
  if (frame.color) image.color.resize(image.depth.size());
  workers.run(height, static_cast<std::size_t>(frame.depth.width) * height, [&](int first, int last) {
    read_depth(frame.depth, config, first, last, image.depth.data());
    if (!frame.color) return;
    for (int t = first; t < last; ++t)
      for (int s = 0; s < width; ++s)
        image.color[static_cast<std::size_t>(t) * width + s] =
            packed(read_color(*frame.color, config.decimation * s, config.decimation * t));
  });
}

void sample_means(const DepthFrame& frame, const Config& config, SamplingRoom& room, WorkingImage& image) {
  const int width = image.intrinsics.width, height = image.intrinsics.height;
  const Sampling sampling(config);
  SampledDepth& sampled = room.sampled;
  sampled.resize(static_cast<std::size_t>(width) * height);
  if (frame.color) image.color.resize(sampled.means.size());
  const std::size_t pixels = static_cast<std::size_t>(frame.depth.width) * frame.depth.height;
  room.workers.run(height, frame.color ? 2 * pixels : pixels, [&](int first, int last) {
    BandSampler band(sampling, frame.depth, width);
    std::optional<MeanColors> colors;
    if (frame.color) colors.emplace(*frame.color, band.rows(), sampling, config);
    for (int t = first; t < last; ++t) {
      band.sample_row(t, sampled);
      if (colors) colors->fill_row(t, sampled, &image.color[static_cast<std::size_t>(t) * width], width);
    }
  });
  image.depth = sampling.in_range(sampled.means, width, height);
}

}  // namespace

/// 32 bits hold the number, and are as wide as the depths: so the compiler makes vectors of the loop.
WIDE_VECTORS std::size_t WorkingImage::measured_pixels() const {
  std::uint32_t count = 0;
  for (const float d : depth) count += d != 0 ? 1 : 0;
  return count;
}

bool same_camera(const Intrinsics& a, const Intrinsics& b) {
  return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.width == b.width && a.height == b.height;
}

WorkingImage make_working_image(const DepthFrame& frame, const Config& config, double max_voxels, SamplingRoom& room) {
  check_depth(frame.depth, config);
  check_intrinsics(frame.intrinsics, frame.depth);
  check_grid_size(frame.intrinsics, config, max_voxels);
  check_pose(frame.T_world_camera);
  if (frame.color) check_color(*frame.color, frame.depth);

  WorkingImage image;
  image.intrinsics = decimated(frame.intrinsics, config.decimation);
  if (config.sampling == "mean" && config.decimation > 1)
    sample_means(frame, config, room, image);
  else
    sample_nearest(frame, config, room.workers, image);
  return image;
}

WorkingImage working_image_of(const SavedView& view) {
  WorkingImage image = {view.intrinsics, {}, {}};
  for (const std::uint16_t steps : view.depth) image.depth.push_back(static_cast<float>(steps * view.depth_step));
  return image;
}

}  // namespace frontier_surfels
