/// Observed space C~ of a frame - paper 3.3, eq. (9)-(11); kernels/stages/1_observed_space.cl.
#pragma once

#include "stages/frame.hpp"

namespace frontier_surfels {

class ObservedSpace {
 public:
  explicit ObservedSpace(Commands& commands);

  /// @param camera  the frame's camera, with its image
  void compute(const Camera& camera);

  const BitField& bits() const { return observed_; }  ///< C~, a bit for each voxel; SPARE_WORDS more words can be read

  /// [height][width] of the working image: first layer that is not observed, in the pixel's column of the pyramid; 0 without a measurement.
  const DeviceArray<cl_int>& column_end() const { return column_end_; }

 private:
  Commands& commands_;
  DeviceArray<cl_int> column_end_;
  DeviceArray<cl_uint> valid_;  ///< a bit for each pixel
  BitField observed_;
};

}  // namespace frontier_surfels
