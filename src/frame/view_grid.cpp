#include "frame/view_grid.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

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

ViewGrid make_view_grid(const Intrinsics& camera, const Config& config) {
  const double f = (camera.fx + camera.fy) / 2, k_min = config.padding_k + f;
  const double size_k = std::ceil(f * std::log(config.z_max / config.z_min) + k_min) + 1;
  const double size_i = camera.width + 2 * config.padding_i, size_j = camera.height + 2 * config.padding_j;
  constexpr double kMaxVoxels = 2e9;  // voxels are numbered with 32 bits
  if (size_i * size_j * (size_k + 64) > kMaxVoxels)
    throw BadFrame("The view's grid would have " + std::to_string(size_i * size_j * size_k * 1e-9) +
                   " billion voxels, more than 2 billion; raise decimation or lower z_max.");

  ViewGrid view;
  Grid& g = view.grid;
  g.size_i = static_cast<int>(size_i);
  g.size_j = static_cast<int>(size_j);
  g.size_k = static_cast<int>(size_k);
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
