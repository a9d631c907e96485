/// A depth camera on the device: the grid of its views, the grid's fixed tables, and the newest image.
#pragma once

#include <memory>

#include "common/shared.h"
#include "frame/camera_list.hpp"
#include "frame/view_grid.hpp"
#include "frame/working_image.hpp"
#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"
#include "opencl/commands.hpp"

namespace frontier_surfels {

class Camera {
 public:
  /// @param intrinsics  of the working image
  Camera(Commands& commands, const Intrinsics& intrinsics, const Config& config);

  /// Sends a frame's working image to the device. Its intrinsics must be this camera's.
  void set_image(const std::shared_ptr<const WorkingImage>& image);

  const Intrinsics& intrinsics() const { return intrinsics_; }
  const Grid& grid() const { return grid_; }

  /// @name Fixed tables, see ViewGrid
  /// @{
  const DeviceArray<float>& layer_depth() const { return layer_depth_; }
  const DeviceArray<PixelRange>& pixels_i() const { return pixels_i_; }
  const DeviceArray<PixelRange>& pixels_j() const { return pixels_j_; }
  const DeviceArray<PixelRange>& words_i() const { return words_i_; }
  /// @}

  /// @name Newest image, [height][width], see WorkingImage
  /// @{
  const SentArray<float>& depth() const { return depth_; }
  const SentArray<cl_uint>& color() const { return color_; }
  bool has_color() const { return has_color_; }
  /// @}

 private:
  Intrinsics intrinsics_;
  Grid grid_ = {};
  DeviceArray<float> layer_depth_;
  DeviceArray<PixelRange> pixels_i_, pixels_j_, words_i_;
  SentArray<float> depth_;
  SentArray<cl_uint> color_;
  bool has_color_ = false;
};

/// The cameras of recent frames. Cameras that take turns keep their tables.
class Cameras {
 public:
  Cameras(Commands& commands, const Config& config);

  /// Largest number of a grid's voxels for which the device has memory.
  double max_voxels() const { return max_voxels_; }

  /// Finds the camera with these intrinsics (of its working image), or makes one. The reference is valid until the next call.
  Camera& find(const Intrinsics& intrinsics);

 private:
  Commands& commands_;
  const Config config_;
  double max_voxels_;
  CameraList<Camera> cameras_;
};

}  // namespace frontier_surfels
