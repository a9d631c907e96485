#include "frame/working_image.hpp"

#include <cmath>
#include <string>

#include "frame/depth_pixels.hpp"
#include "frame/view_grid.hpp"
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

/// Meaning of a raw depth [m]: > 0 a surface at this depth, < 0 free space up to its magnitude, 0 no measurement.
float interpret(float d, const Config& config) {
  const float z_max = static_cast<float>(config.z_max);
  if (std::isnan(d) || d < static_cast<float>(config.z_min)) return 0;
  if (d <= z_max) return d;
  return (std::isinf(d) ? config.carve_no_return : config.carve_beyond_range) ? -z_max : 0;
}

/// Depths of every decimation-th pixel in both directions [m]. @tparam Pixel  unsigned integer of the image's pixel size
template <typename Pixel>
std::vector<float> read_depth(const DepthImage& image, int width, int height, const Config& config) {
  std::vector<float> depth;
  depth.reserve(static_cast<std::size_t>(width) * height);
  for_each_pixel<Pixel>(image, config.decimation,
                        [&](Pixel pixel) { depth.push_back(interpret(to_metres(pixel, config.depth_unit), config)); });
  return depth;
}

std::vector<std::uint32_t> read_color(const ColorImage& image, int width, int height, int step) {
  const int red = image.order == ColorImage::Order::kRgb ? 0 : 2;
  std::vector<std::uint32_t> color;
  color.reserve(static_cast<std::size_t>(width) * height);
  for (int t = 0; t < height; ++t) {
    const std::uint8_t* pixel = image.data + t * step * image.step;
    for (int s = 0; s < width; ++s, pixel += step * image.channels) color.push_back(pixel[red] | pixel[1] << 8 | pixel[2 - red] << 16);
  }
  return color;
}

}  // namespace

bool same_camera(const Intrinsics& a, const Intrinsics& b) {
  return a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.width == b.width && a.height == b.height;
}

WorkingImage make_working_image(const DepthFrame& frame, const Config& config, double max_voxels) {
  check_depth(frame.depth, config);
  check_intrinsics(frame.intrinsics, frame.depth);
  check_grid_size(frame.intrinsics, config, max_voxels);
  check_pose(frame.T_world_camera);
  if (frame.color) check_color(*frame.color, frame.depth);

  WorkingImage image;
  image.intrinsics = decimated(frame.intrinsics, config.decimation);
  const int width = image.intrinsics.width, height = image.intrinsics.height;
  image.depth = frame.depth.encoding == DepthImage::Encoding::kStepsU16 ? read_depth<std::uint16_t>(frame.depth, width, height, config)
                                                                        : read_depth<std::uint32_t>(frame.depth, width, height, config);
  if (frame.color) image.color = read_color(*frame.color, width, height, config.decimation);
  return image;
}

WorkingImage working_image_of(const SavedView& view) {
  WorkingImage image = {view.intrinsics, {}, {}};
  for (const std::uint16_t steps : view.depth) image.depth.push_back(static_cast<float>(steps * view.depth_step));
  return image;
}

}  // namespace frontier_surfels
