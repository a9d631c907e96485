#include "frame/camera.hpp"

#include <algorithm>

namespace frontier_surfels {
namespace {

constexpr double kLeastBytesPerVoxel = 1.5;  // of the device's memory; small grids need more

}  // namespace

Camera::Camera(Commands& commands, const Intrinsics& intrinsics, const Config& config)
    : intrinsics_(intrinsics),
      layer_depth_(commands),
      pixels_i_(commands),
      pixels_j_(commands),
      words_i_(commands),
      depth_(commands),
      color_(commands) {
  const ViewGrid view = make_view_grid(intrinsics, config);
  grid_ = view.grid;
  layer_depth_.write(view.layer_depth);
  pixels_i_.write(view.pixels_i);
  pixels_j_.write(view.pixels_j);
  words_i_.write(view.words_i);
}

void Camera::set_image(const std::shared_ptr<const WorkingImage>& image) {
  depth_.send(std::shared_ptr<const std::vector<float>>(image, &image->depth));
  color_.send(std::shared_ptr<const std::vector<std::uint32_t>>(image, &image->color));
  has_color_ = !image->color.empty();
}

Cameras::Cameras(Commands& commands, const Config& config) : commands_(commands), config_(config) {
  const double bytes = static_cast<double>(commands.device().device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>());
  max_voxels_ = std::min(kMaxVoxels, bytes / kLeastBytesPerVoxel);
}

Camera& Cameras::find(const Intrinsics& intrinsics) { return cameras_.use(intrinsics, commands_, intrinsics, config_); }

}  // namespace frontier_surfels
