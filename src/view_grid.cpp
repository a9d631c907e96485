#include "view_grid.hpp"

#include <algorithm>
#include <cmath>

namespace frontier_surfels {
namespace {

/// Pixels (of `pixels`) whose sample of layer k lies in each of `size` voxels: s with round((s - c) (k - k_p) / f + center) = voxel.
void add_footprints(std::vector<PixelRange>& ranges, int size, int pixels, double c, double f, double layers, double center) {
  const std::size_t first = ranges.size();
  ranges.resize(first + size, PixelRange{0, 0});
  for (int s = 0; s < pixels; ++s) {
    const double voxel = std::floor((s - c) * layers / f + center + 0.5);
    if (voxel < 0 || voxel >= size) continue;
    PixelRange& range = ranges[first + static_cast<std::size_t>(voxel)];
    if (range[0] == range[1]) range[0] = static_cast<std::uint16_t>(s);
    range[1] = static_cast<std::uint16_t>(s + 1);
  }
}

}  // namespace

ViewGrid make_view_grid(const Intrinsics& camera, const Config& config) {
  const double f = (camera.fx + camera.fy) / 2, k_min = config.padding_k + f;
  const double size_k = std::ceil(f * std::log(config.z_max / config.z_min) + k_min) + 1;
  const double size_i = camera.width + 2 * config.padding_i, size_j = camera.height + 2 * config.padding_j;
  constexpr double kMostVoxels = 2e9;  // 32-bit numbers of voxels
  if (size_i * size_j * (size_k + 64) > kMostVoxels)
    throw BadFrame("The view's grid would have " + std::to_string(size_i * size_j * size_k * 1e-9) +
                   " billion voxels, more than 2; raise decimation or lower z_max.");

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
  for (int k = 0; k < g.first_pyramid_layer; ++k) {
    const double layers = k - config.padding_k;
    add_footprints(view.pixels_i, g.size_i, k < config.padding_k ? 0 : g.width, camera.cx, f, layers, camera.cx + config.padding_i);
    add_footprints(view.pixels_j, g.size_j, k < config.padding_k ? 0 : g.height, camera.cy, f, layers, camera.cy + config.padding_j);
  }
  return view;
}

}  // namespace frontier_surfels
