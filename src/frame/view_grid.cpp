#include "frame/view_grid.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "frontier_surfels/number_text.hpp"

namespace frontier_surfels {
namespace {

constexpr int kMaxPixels = 16384;   // a row or column; the cuboid's tables number pixels with 16 bits
constexpr int kMaxDecimation = 64;  // see Config

double focal_length(const Intrinsics& camera) { return (camera.fx + camera.fy) / 2; }

double layers_of(const Intrinsics& camera, const Config& config) {
  const double f = focal_length(camera);
  return std::ceil(f * std::log(config.z_max / config.z_min) + config.padding_k + f) + 1;
}

/// Number of voxels for which there must be room: layers come in words of 64.
double voxels_of(const Intrinsics& camera, const Config& config) {
  const double size_i = camera.width + 2.0 * config.padding_i, size_j = camera.height + 2.0 * config.padding_j;
  return size_i * size_j * (layers_of(camera, config) + 64);
}

/// A number of voxels in billions, with a digit.
std::string billions(double voxels) { return fixed_text(voxels * 1e-9, 1); }

/// An axis of the cuboid and of the image.
struct Axis {
  int size, pixels;         ///< [voxel], [pixel]
  double c, f;              ///< principal point, focal length [pixel]
  int padding_k, layers_k;  ///< number of layers without samples, and of all layers of the cuboid
  double center;            ///< [voxel]
};

/// Finds for each voxel of layer k the pixels whose sample lies in it: all s with round((s - c) (k - k_p) / f + center) = voxel.
void set_footprints(const Axis& axis, int k, PixelRange* ranges) {
  for (int s = 0; s < axis.pixels; ++s) {
    const double voxel = std::floor((s - axis.c) * (k - axis.padding_k) / axis.f + axis.center + 0.5);
    if (voxel < 0 || voxel >= axis.size) continue;
    PixelRange& range = ranges[static_cast<std::size_t>(voxel)];
    if (range[0] == range[1]) range[0] = static_cast<std::uint16_t>(s);
    range[1] = static_cast<std::uint16_t>(s + 1);
  }
}

std::vector<PixelRange> find_pixels(const Axis& axis) {
  const std::size_t layers = (axis.layers_k + 63) / 64 * 64, size = (axis.size + TABLE_CHUNK - 1) / TABLE_CHUNK * TABLE_CHUNK;
  std::vector<PixelRange> pixels(layers * size, PixelRange{0, 0});
  for (int k = axis.padding_k; k < axis.layers_k; ++k) set_footprints(axis, k, &pixels[k * size]);
  return pixels;
}

/// For each chunk of LANES voxels the words of 32 pixels in which its pixels lie.
std::vector<PixelRange> find_words(const std::vector<PixelRange>& pixels) {
  std::vector<PixelRange> words(pixels.size() / TABLE_CHUNK, PixelRange{0, 0});
  for (std::size_t n = 0; n < pixels.size(); ++n) {
    if (pixels[n][0] == pixels[n][1]) continue;
    PixelRange& range = words[n / TABLE_CHUNK];
    if (range[0] == range[1]) range[0] = pixels[n][0] / 32;
    range[1] = static_cast<std::uint16_t>((pixels[n][1] + 31) / 32);
  }
  return words;
}

}  // namespace

Intrinsics decimated(const Intrinsics& full, int step) {
  return {full.fx / step, full.fy / step, full.cx / step, full.cy / step, full.width / step, full.height / step};
}

void check_grid_size(const Intrinsics& full, const Config& config, double max_voxels) {
  const auto fits = [&](int step) {
    const Intrinsics camera = decimated(full, step);
    return std::max(camera.width, camera.height) <= kMaxPixels && voxels_of(camera, config) <= max_voxels;
  };
  if (fits(config.decimation)) return;

  const Intrinsics camera = decimated(full, config.decimation);
  const bool has_too_many_pixels = std::max(camera.width, camera.height) > kMaxPixels;
  std::string text = "The depth image of " + std::to_string(full.width) + " x " + std::to_string(full.height) + " pixels is too large: ";
  text += has_too_many_pixels ? "rows and columns can have " + std::to_string(kMaxPixels) + " pixels after decimation. "
                              : "its grid would have " + billions(voxels_of(camera, config)) +
                                    " billion voxels, but this device has room for " + billions(max_voxels) + ". ";
  const int largest = std::min({kMaxDecimation, full.width, full.height});
  int step = config.decimation + 1;
  while (step <= largest && !fits(step)) ++step;
  text += step <= largest ? "Set decimation to " + std::to_string(step) : "No decimation would do: scale the images down";
  throw BadFrame(text + (has_too_many_pixels ? "." : ", or lower z_max."));
}

ViewGrid make_view_grid(const Intrinsics& camera, const Config& config) {
  const double f = focal_length(camera), k_min = config.padding_k + f;
  ViewGrid view;
  Grid& g = view.grid;
  g.size_i = camera.width + 2 * config.padding_i;
  g.size_j = camera.height + 2 * config.padding_j;
  g.size_k = static_cast<int>(layers_of(camera, config));
  g.words_k = (g.size_k + 63) / 64;
  g.width = camera.width;
  g.height = camera.height;
  g.padding_i = config.padding_i;
  g.padding_j = config.padding_j;
  g.padding_k = config.padding_k;
  g.first_pyramid_layer = static_cast<int>(std::ceil(k_min));
  g.fx = static_cast<float>(camera.fx);
  g.fy = static_cast<float>(camera.fy);
  g.f = static_cast<float>(f);
  g.center_i = static_cast<float>(camera.cx + config.padding_i);
  g.center_j = static_cast<float>(camera.cy + config.padding_j);
  g.k_min = static_cast<float>(k_min);
  g.z_min = static_cast<float>(config.z_min);
  g.z_max = static_cast<float>(config.z_max);
  g.delta_min = static_cast<float>(config.z_min / f);

  for (int k = 0; k < g.size_k; ++k) {
    const double z = k < k_min ? (k - config.padding_k) * config.z_min / f : config.z_min * std::exp((k - k_min) / f);
    view.layer_depth.push_back(static_cast<float>(z));
  }
  const int padding_k = config.padding_k, layers_k = g.first_pyramid_layer;
  view.pixels_i = find_pixels({g.size_i, g.width, camera.cx, f, padding_k, layers_k, camera.cx + config.padding_i});
  view.pixels_j = find_pixels({g.size_j, g.height, camera.cy, f, padding_k, layers_k, camera.cy + config.padding_j});
  view.words_i = find_words(view.pixels_i);
  return view;
}

}  // namespace frontier_surfels
