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

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "frontier_surfels/config.hpp"
#include "frontier_surfels/types.hpp"

namespace frontier_surfels {

/// Meaning of a depth [m]: > 0 a surface at this depth, < 0 free space up to its magnitude, 0 no measurement.
class DepthMeaning {
 public:
  explicit DepthMeaning(const Config& config)
      : z_min_(static_cast<float>(config.z_min)),
        z_max_(static_cast<float>(config.z_max)),
        beyond_range_(config.carve_beyond_range ? -z_max_ : 0),
        no_return_(config.carve_no_return ? -z_max_ : 0) {}

  float operator()(float d) const {
    const float farther = d == std::numeric_limits<float>::infinity() ? no_return_ : beyond_range_, measured = d <= z_max_ ? d : farther;
    return d >= z_min_ ? measured : 0;  // NaN is not, either
  }

 private:
  float z_min_, z_max_, beyond_range_, no_return_;
};

/// The rows of a depth image that a row of blocks has, at the image's own resolution. Every decimation-th pixel of a row lies beside the
/// next one. There are blank pixels around the image. Depths are in metres, 0: no measurement, +Inf: nothing within the camera's range.
class DepthRows {
 public:
  /// @param margin  rows above and below the middle of a block, and width of the blank border [pixel], at most `decimation`
  DepthRows(const DepthImage& image, const Config& config, int margin);

  void move_to(int t);  ///< reads the rows of block row t, which must not lie above those of the last call

  /// Pixels column, column + decimation, column + 2 decimation ... of a row. @param column  -margin ... decimation - 1
  const float* every(int column, int row) const { return planes_of(row) + offset_of(column); }

  const float* planes_of(int row) const { return &depth_[first_of(row)]; }
  /// From the planes of a row to every(column, row).
  std::ptrdiff_t offset_of(int column) const { return column < 0 ? (column + decimation_) * stride_ : column * stride_ + 1; }

 private:
  void read(int row, float* planes);
  std::size_t first_of(int row) const { return static_cast<std::size_t>((row + margin_) % rows_) * decimation_ * stride_; }

  const DepthImage& image_;
  double depth_unit_;
  float no_return_, far_;  ///< what +Inf becomes, and the largest other depth
  int decimation_, margin_, rows_, stride_;
  int next_;                   ///< row to be read next
  std::vector<float> of_row_;  ///< a row in its own order
  std::vector<float> depth_;   ///< [rows_][decimation][stride_]: row r in place (r + margin) % rows_
};

/// What the blocks of an image have measured.
struct SampledDepth {
  void resize(std::size_t blocks) {
    means.resize(blocks);
    pivots.resize(blocks);
    whole.resize(blocks);
  }

  std::vector<float> means;   ///< [height / decimation][width / decimation] [m]; 0: none, +Inf: no return
  std::vector<float> pivots;  ///< likewise: the pixels that agree with this depth were used; 0: none
  std::vector<int> whole;     ///< likewise: do all pixels of the block agree?
};

class Sampling {
 public:
  explicit Sampling(const Config& config);

  /// Depths as DepthMeaning says, of means in an image of this size.
  std::vector<float> in_range(const std::vector<float>& means, int width, int height) const;

  /// Calls visit(depth, dx, dy) for each pixel of block (s, t), row by row. @param visit  dx, dy: from the middle
  template <typename Visit>
  void for_each_pixel_of(const DepthRows& rows, int s, int t, Visit visit) const {
    for (int dy = -radius_; dy <= radius_; ++dy) {
      const float* planes = rows.planes_of(config_.decimation * t + dy) + s;
      for (int dx = -radius_; dx <= radius_; ++dx) visit(planes[rows.offset_of(dx)], dx, dy);
    }
  }

  int radius() const { return radius_; }  ///< a block has 2 radius + 1 pixels along each edge
  /// Pixels whose depths differ by no more measure the same surface [m].
  float tolerance(float depth) const { return std::max(agreement_ * depth, constant_ + growth_ * depth * depth); }
  /// Depth of a pixel that agrees with a pivot [m]; never 0.
  float lowest(float pivot) const { return std::max(pivot - tolerance(pivot), std::numeric_limits<float>::min()); }
  float highest(float pivot) const { return pivot + tolerance(pivot); }

 private:
  friend class BandSampler;
  float fill(const DepthRows& rows, int s, int t, float* pivot) const;
  bool has_no_return(const DepthRows& rows, int s, int t) const;

  const Config& config_;
  int radius_, least_;
  float agreement_, constant_, growth_;
};

/// Samples rows of blocks, one after the other.
class BandSampler {
 public:
  /// @param width  of the working image
  BandSampler(const Sampling& sampling, const DepthImage& image, int width);

  /// Row t of the working image. @param t  larger than the last one
  void sample_row(int t, SampledDepth& sampled);

  const DepthRows& rows() const { return rows_; }  ///< those of the last row

 private:
  void begin_count(const float* pivots);
  void count(int t);
  void take_means(const float* pivots, float* means, float* pivots_used, int* whole);

  const Sampling& sampling_;
  DepthRows rows_;
  // Of each block of a row: limits of the depths that agree, their sum and their number, and the numbers of those that are farther and of
  // all that have measured something
  std::vector<float> lowest_, highest_, sum_;
  std::vector<int> agree_, farther_, measured_;
  // Likewise: do too few agree? Must the pixels be looked at again?
  std::vector<int> is_unclear_, is_odd_;
};

}  // namespace frontier_surfels
