#include "scoring/exact_test_view.hpp"

#include <algorithm>
#include <limits>

namespace frontier_surfels::scoring {

namespace {

/// What rounding may do to a projection and to a depth; far above it, far below what costs time.
constexpr double kPixelMargin = 1e-3;  // [pixel]
constexpr double kDepthMargin = 1e-6;  // [m]

/// Balls that come closer to the camera's plane have no bounded projection [m].
constexpr double kNearest = 1e-2;

}  // namespace

ExactView::ExactView(const DepthFrame& frame, const DepthReading& reading)
    : T_camera_world_(frame.T_world_camera.inverse()), T_world_camera_(frame.T_world_camera) {
  DecimatedDepth decimated = decimate(frame, reading);
  fx_ = decimated.intrinsics.fx;
  fy_ = decimated.intrinsics.fy;
  cx_ = decimated.intrinsics.cx;
  cy_ = decimated.intrinsics.cy;
  width_ = decimated.intrinsics.width;
  height_ = decimated.intrinsics.height;
  depth_ = std::move(decimated.depth);
  has_measurements_ = std::any_of(depth_.begin(), depth_.end(), [](float d) { return d != 0; });
  make_tiles();
}

void ExactView::make_tiles() {
  tiles_per_row_ = (width_ + kTile - 1) / kTile;
  const int tile_rows = (height_ + kTile - 1) / kTile;
  tiles_.assign(static_cast<std::size_t>(tiles_per_row_) * tile_rows, {std::numeric_limits<float>::infinity(), 0.f});
  for (int t = 0; t < height_; ++t) {
    for (int s = 0; s < width_; ++s) {
      Bounds& tile = tiles_[(t / kTile) * tiles_per_row_ + s / kTile];
      tile.min = std::min(tile.min, depth(s, t));
      tile.max = std::max(tile.max, depth(s, t));
    }
  }
}

ExactView::Bounds ExactView::bounds(const PixelRange& columns, const PixelRange& rows) const {
  Bounds result{std::numeric_limits<float>::infinity(), 0.f};
  for (int row = rows.first / kTile; row <= rows.last / kTile; ++row) {
    for (int column = columns.first / kTile; column <= columns.last / kTile; ++column) {
      const Bounds& tile = tiles_[row * tiles_per_row_ + column];
      result.min = std::min(result.min, tile.min);
      result.max = std::max(result.max, tile.max);
    }
  }
  return result;
}

Coverage ExactView::coverage(const Eigen::Vector3d& centre_world, double radius) const {
  const Eigen::Vector3d centre = T_camera_world_ * centre_world;
  const double z_near = centre.z() - radius, z_far = centre.z() + radius;
  if (z_far < 0 || !has_measurements_) return Coverage::kNone;
  if (!(z_near > kNearest)) return Coverage::kSome;

  // The ball lies in a cube, whose faces at z_near and z_far hold the extreme directions.
  const auto project = [&](double x, double focal_length, double principal_point, int size) {
    const double low = std::min((x - radius) / z_near, (x - radius) / z_far);
    const double high = std::max((x + radius) / z_near, (x + radius) / z_far);
    const double first = focal_length * low + principal_point + 0.5 - kPixelMargin;
    const double last = focal_length * high + principal_point + 0.5 + kPixelMargin;
    if (!(last >= 0 && first < size)) return PixelRange{0, -1, true};
    return PixelRange{static_cast<int>(std::max(first, 0.0)), static_cast<int>(std::min<double>(last, size - 1)),
                      first < 0 || last >= size};
  };
  const PixelRange columns = project(centre.x(), fx_, cx_, width_);
  const PixelRange rows = project(centre.y(), fy_, cy_, height_);
  if (columns.last < columns.first || rows.last < rows.first) return Coverage::kNone;

  const Bounds depth_bounds = bounds(columns, rows);
  if (depth_bounds.max < z_near - kDepthMargin) return Coverage::kNone;
  const bool touches_void =
      std::any_of(voids_.begin(), voids_.end(), [&](const OrientedBox& box) { return box.distance(centre_world) <= radius; });
  if (!columns.clipped && !rows.clipped && depth_bounds.min > z_far + kDepthMargin && !touches_void) return Coverage::kAll;
  return Coverage::kSome;
}

}  // namespace frontier_surfels::scoring
