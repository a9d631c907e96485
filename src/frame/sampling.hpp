/// Sampling, ours: a depth of the working image is the mean of the pixels around it that measure the same surface. The paper takes one
/// pixel and throws the others away (`sampling: nearest`).
///
/// The pixels of a block are those up to decimation / 2 columns and rows from pixel (decimation s, decimation t), its middle. The block
/// measures the mean of those that agree with its pivot: their depths differ from the pivot's by at most a tolerance. The pivot is the
/// middle pixel. There is no measurement
///  * if fewer than a sixth of the pixels agree;
///  * on a slope between foreground and background, where more pixels are nearer than agree, and more are farther.
/// Then, or where the middle pixel is lost, the nearest other pixel is the pivot; but the pixels that agree with it must lie on all sides
/// of the middle one, and there must be eight times as many of them as of others. So holes and outliers in a surface are filled, and gaps
/// beside one are not.
#pragma once

#include <cstdint>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Meaning of a depth [m]: > 0 a surface at this depth, < 0 free space up to its magnitude, 0 no measurement.
float interpret(float d, const Config& config);

/// A depth image at its own resolution, whose pixels can be read in rows: every decimation-th pixel of a row lies beside the next one.
/// There are blank pixels around it. Depths are in metres, 0: no measurement, +Inf: nothing within the camera's range.
class DepthPlanes {
 public:
  /// @param margin  width of the blank border [pixel], at most `decimation`
  DepthPlanes(const DepthImage& image, const Config& config, int margin);

  /// Pixels column, column + decimation, column + 2 decimation ... of a row. @param column  -margin ... decimation - 1
  const float* every(int column, int row) const;
  float at(int column, int row) const;

 private:
  template <typename Pixel>
  void read(const DepthImage& image, const Config& config, int first_row, int last_row);

  int decimation_, margin_, stride_;
  std::vector<float> depth_;  ///< [rows][decimation][stride_]
};

/// What the blocks of an image have measured.
struct SampledDepth {
  std::vector<float> depth;         ///< depth[height / decimation][width / decimation] [m], as interpret() says
  std::vector<float> pivots;        ///< likewise: the pixels that agree with this depth were used; 0: none
  std::vector<std::uint8_t> whole;  ///< likewise: do all pixels of the block agree?
};

class Sampling {
 public:
  explicit Sampling(const Config& config);

  DepthPlanes planes(const DepthImage& image) const { return {image, config_, radius_}; }

  /// @param width, height  of the working image
  SampledDepth sample(const DepthPlanes& planes, int width, int height) const;

  /// Calls visit(depth, dx, dy) for each pixel of block (s, t), row by row. @param visit  dx, dy: from the middle
  template <typename Visit>
  void for_each_pixel_of(const DepthPlanes& planes, int s, int t, Visit visit) const {
    for (int dy = -radius_; dy <= radius_; ++dy)
      for (int dx = -radius_; dx <= radius_; ++dx) visit(planes.at(config_.decimation * s + dx, config_.decimation * t + dy), dx, dy);
  }

  int radius() const { return radius_; }  ///< a block has 2 radius + 1 pixels along each edge
  float tolerance(float depth) const;     ///< pixels whose depths differ by no more measure the same surface [m]
  float lowest(float pivot) const;        ///< depth of a pixel that agrees with a pivot [m]; never 0
  float highest(float pivot) const { return pivot + tolerance(pivot); }

 private:
  struct Row;
  void sample_rows(const DepthPlanes& planes, int width, int first, int last, float* means, SampledDepth& sampled) const;
  void sample_row(const DepthPlanes& planes, int t, Row& row) const;
  float fill(const DepthPlanes& planes, int s, int t, float* pivot) const;
  bool has_no_return(const DepthPlanes& planes, int s, int t) const;
  std::vector<float> in_range(const std::vector<float>& means, int width, int height) const;

  const Config& config_;
  int radius_, least_;
  float agreement_, constant_, growth_;
};

}  // namespace frontier_surfels
