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

/// The rows of a depth image that a row of blocks has, at the image's own resolution. Every decimation-th pixel of a row lies beside the
/// next one. There are blank pixels around the image. Depths are in metres, 0: no measurement, +Inf: nothing within the camera's range.
class DepthRows {
 public:
  /// @param margin  rows above and below the middle of a block, and width of the blank border [pixel], at most `decimation`
  DepthRows(const DepthImage& image, const Config& config, int margin);

  void move_to(int t);  ///< reads the rows of block row t, which must not lie above those of the last call

  /// Pixels column, column + decimation, column + 2 decimation ... of a row. @param column  -margin ... decimation - 1
  const float* every(int column, int row) const;
  float at(int column, int row) const;

 private:
  template <typename Pixel>
  void read(int row, float* planes);
  float* planes_of(int row) { return &depth_[static_cast<std::size_t>((row + margin_) % rows_) * decimation_ * stride_]; }

  const DepthImage& image_;
  double depth_unit_;
  float no_return_, far_;  ///< what +Inf becomes, and what is farther than this
  int decimation_, margin_, rows_, stride_;
  int next_;                   ///< row to be read next
  std::vector<float> of_row_;  ///< a row in its own order
  std::vector<float> depth_;   ///< [rows_][decimation][stride_]: row r in place (r + margin) % rows_
};

/// What the blocks of an image have measured.
struct SampledDepth {
  explicit SampledDepth(std::size_t blocks) : means(blocks), pivots(blocks), whole(blocks) {}

  std::vector<float> means;         ///< [height / decimation][width / decimation] [m]; 0: none, +Inf: no return
  std::vector<float> pivots;        ///< likewise: the pixels that agree with this depth were used; 0: none
  std::vector<std::uint8_t> whole;  ///< likewise: do all pixels of the block agree?
};

class Sampling {
 public:
  explicit Sampling(const Config& config);

  /// Depths as interpret() says, of means in an image of this size.
  std::vector<float> in_range(const std::vector<float>& means, int width, int height) const;

  /// Calls visit(depth, dx, dy) for each pixel of block (s, t), row by row. @param visit  dx, dy: from the middle
  template <typename Visit>
  void for_each_pixel_of(const DepthRows& rows, int s, int t, Visit visit) const {
    for (int dy = -radius_; dy <= radius_; ++dy)
      for (int dx = -radius_; dx <= radius_; ++dx) visit(rows.at(config_.decimation * s + dx, config_.decimation * t + dy), dx, dy);
  }

  int radius() const { return radius_; }  ///< a block has 2 radius + 1 pixels along each edge
  float tolerance(float depth) const;     ///< pixels whose depths differ by no more measure the same surface [m]
  float lowest(float pivot) const;        ///< depth of a pixel that agrees with a pivot [m]; never 0
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
  void count(int t);

  const Sampling& sampling_;
  DepthRows rows_;
  // Of each block of a row: limits of the depths that agree, their sum and their number, and the numbers of the other pixels
  std::vector<float> lowest_, highest_, sum_;
  std::vector<int> agree_, nearer_, farther_;
};

}  // namespace frontier_surfels
