/// Counts the depths of an image that the mapper can use, and the others by their fault.
#pragma once

#include <cstddef>
#include <limits>
#include <string>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Number of the pixels of a depth image, by what they are: of every decimation-th column and row, or of all pixels if none of these has
/// measured anything, because `sampling: mean` uses the others as well. Depths that only carve free space are usable.
struct DepthCensus {
  std::size_t usable = 0;
  std::size_t carved = 0;                                  ///< of the usable ones: beyond z_max, they carve free space
  std::size_t missing = 0;                                 ///< 0, NaN or negative
  std::size_t saturated = 0;                               ///< 65535 in a 16-bit image
  std::size_t too_near = 0;                                ///< below z_min
  std::size_t too_far = 0;                                 ///< beyond z_max
  std::size_t infinite = 0;                                ///< +Inf, usable or too far: no surface within the camera's range
  bool in_metres = false;                                  ///< 32-bit image
  float nearest = std::numeric_limits<float>::infinity();  ///< smallest depth, usable or not [m]
  float farthest = 0;                                      ///< largest finite depth, usable or not [m]
  std::size_t in_working_image = 0;                        ///< pixels of the working image that have measured something

  std::size_t measured() const { return usable + saturated + too_near + too_far; }

  /// Why nothing is in the working image: no_measurement, saturated, too_near, too_far or out_of_range if no pixel is usable, no_agreement
  /// if some are, but no pixels around one measure the same surface; empty if something is.
  std::string reason() const;

  /// Adds the counts of another image.
  DepthCensus& operator+=(const DepthCensus& other);
};

/// @param image             with data and a valid size
/// @param in_working_image  Report::measured_pixels of the image
DepthCensus count_depths(const DepthImage& image, const Config& config, std::size_t in_working_image);

/// A sentence about images of which nearly no measured depth is a surface from z_min to z_max, as with a wrong unit; empty if enough are,
/// or if no depth is usable. Depths that only carve free space are none, and those of +Inf do not count. @param depths  of several images
std::string few_in_range(const DepthCensus& depths, const Config& config);

/// "z_min = 0.4 m to z_max = 3 m", for messages.
std::string depth_range(const Config& config);

/// End of a sentence about images whose reason is no_agreement: "depths from z_min = 0.5 m to z_max = 3 m, but around no pixel ...".
std::string no_agreement(const Config& config);

/// End of a sentence about depths out of range, whose unit may be wrong: "from 20 to 60 m: 16-bit images are read in steps of ...".
std::string range_and_remedy(const DepthCensus& depths, const Config& config);

}  // namespace frontier_surfels
