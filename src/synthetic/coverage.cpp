#include "synthetic/coverage.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "config/config_text.hpp"
#include "scoring/decimated_depth.hpp"
#include "scoring/parallel.hpp"
#include "synthetic/camera_lattice.hpp"

namespace frontier_surfels::replay {
namespace {

using Eigen::Array3i;
using Eigen::Vector3d;

constexpr std::size_t kBatch = 256;  // points that a thread looks at before it asks for more
constexpr double kLift = 1e-3;       // [m] above its surface a point is seen or not, so that its own surface does not hide it
constexpr double kHalfPixel = 0.71;  // [pixel] half the diagonal
constexpr double kDeviations = 3;

/// Which points can be seen from the lattice.
std::vector<std::uint8_t> visible(const World& world, const CameraLattice& lattice, const std::vector<SurfacePoint>& points,
                                  const CoverageOptions& options, double min_cosine) {
  std::vector<std::uint8_t> visible(points.size(), 0);
  const auto look_at = [&](std::size_t i) {
    const SurfacePoint& point = points[i];
    const Vector3d target = point.position + kLift * point.normal;
    visible[i] = lattice.any_near(point.position, options.z_max, [&](const Vector3d& camera) {
      const Vector3d to_camera = camera - point.position;
      const double distance = to_camera.norm();
      return distance >= options.z_min && distance <= options.z_max && to_camera.dot(point.normal) > min_cosine * distance &&
             world.sees(camera, target);
    });
  };
  scoring::parallel_for((points.size() + kBatch - 1) / kBatch, options.threads, [&](std::size_t batch) {
    for (std::size_t i = batch * kBatch; i < std::min(points.size(), (batch + 1) * kBatch); ++i) look_at(i);
  });
  return visible;
}

void check_image(const DepthFrame& frame) {
  const DepthImage& depth = frame.depth;
  const std::size_t pixel = depth.encoding == DepthImage::Encoding::kStepsU16 ? 2 : 4;
  if (depth.data == nullptr || depth.width < 1 || depth.height < 1 || depth.step < pixel * static_cast<std::size_t>(depth.width))
    throw BadFrame("The depth image has no pixels, or its rows are shorter than its width.");
  if (depth.width != frame.intrinsics.width || depth.height != frame.intrinsics.height)
    throw BadFrame("The size of the depth image is not that of its intrinsics.");
  const Intrinsics& camera = frame.intrinsics;
  if (!(camera.fx > 0 && camera.fy > 0 && std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy)))
    throw BadFrame("The intrinsics must be finite, with fx and fy above 0.");
  if (!frame.T_world_camera.matrix().allFinite()) throw BadFrame("The pose of the image is not finite.");
}

/// An image that asks which points it sees.
class Look {
 public:
  Look(const DepthFrame& frame, const CoverageOptions& options, double min_cosine)
      : frame_(frame),
        options_(options),
        min_cosine_(min_cosine),
        p_camera_(frame.T_world_camera.translation()),
        R_camera_world_(frame.T_world_camera.linear().transpose()) {}

  bool sees(const SurfacePoint& point) const {
    const Vector3d to_point = point.position - p_camera_;
    const double z = R_camera_world_.row(2).dot(to_point);
    if (!(z >= options_.z_min && z <= options_.z_max)) return false;
    const double cosine = -to_point.dot(point.normal) / to_point.norm();
    if (!(cosine > min_cosine_)) return false;
    const Intrinsics& camera = frame_.intrinsics;
    const double column = std::floor(camera.fx * R_camera_world_.row(0).dot(to_point) / z + camera.cx + 0.5);
    const double row = std::floor(camera.fy * R_camera_world_.row(1).dot(to_point) / z + camera.cy + 0.5);
    if (!(column >= 0 && column < camera.width && row >= 0 && row < camera.height)) return false;
    const double depth = scoring::read_depth(frame_.depth, static_cast<int>(column), static_cast<int>(row), options_.depth_unit);
    if (!(depth >= options_.z_min && depth <= options_.z_max)) return false;
    const double tolerance =
        options_.depth_tolerance + kDeviations * options_.noise_growth * z * z + kHalfPixel * z / (std::min(camera.fx, camera.fy) * cosine);
    return std::abs(depth - z) <= tolerance;
  }

 private:
  const DepthFrame& frame_;
  const CoverageOptions& options_;
  double min_cosine_;
  Vector3d p_camera_;
  Eigen::Matrix3d R_camera_world_;
};

}  // namespace

void CoverageOptions::check() const {
  const auto require = [](bool fits, const char* name, double value, const char* what) {
    if (!fits) throw Error(std::string(name) + " of the coverage is " + to_text(value) + ": it must be " + what + ".");
  };
  const auto within = [](double value, double low, double high) { return value >= low && value <= high; };
  require(within(spacing, 0.01, 1), "spacing", spacing, "from 0.01 to 1 m");
  require(within(lattice, 0.05, 5), "lattice", lattice, "from 0.05 to 5 m");
  require(std::isfinite(lowest), "lowest", lowest, "a height in m");
  require(highest >= lowest && std::isfinite(highest), "highest", highest, "a height in m that is not below the lowest");
  require(within(clearance, 0, 10), "clearance", clearance, "from 0 to 10 m");
  require(within(z_min, 1e-3, 100), "z_min", z_min, "from 0.001 to 100 m");
  require(z_max > z_min && z_max <= 100, "z_max", z_max, "above z_min, and at most 100 m");
  require(within(max_incidence, 1, 89.9), "max_incidence", max_incidence, "from 1 to 89.9 degrees");
  require(within(depth_tolerance, 0, 1), "depth_tolerance", depth_tolerance, "from 0 to 1 m");
  require(within(noise_growth, 0, 1), "noise_growth", noise_growth, "from 0 to 1");
  require(within(surfel_distance, 0.005, 1), "surfel_distance", surfel_distance, "from 0.005 to 1 m");
  require(within(depth_unit, 1e-6, 1), "depth_unit", depth_unit, "from 0.000001 to 1 m");
  require(within(threads, 0, 1024), "threads", threads, "from 0 to 1024");
}

Coverage::Coverage(const World& world, const Eigen::AlignedBox3d& bounds, const Vector3d& start, const CoverageOptions& options)
    : options_(options), min_cosine_(std::cos(options.max_incidence * M_PI / 180)) {
  options.check();
  Eigen::AlignedBox3d box = bounds;
  box.min().z() = std::max(box.min().z(), options.lowest);
  box.max().z() = std::min(box.max().z(), options.highest);
  const CameraLattice lattice(world, box, start, options.lattice, options.clearance);
  positions_ = lattice.positions();
  const std::vector<SurfacePoint> all = surface_points(world, options.spacing);
  const std::vector<std::uint8_t> can_be_seen = visible(world, lattice, all, options, min_cosine_);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (can_be_seen[i]) points_.push_back(all[i]);
  }
  if (points_.empty()) throw Error("No surface can be seen from where the camera can go: check z_min, z_max and the start.");
  sort_into_cells();
  reset();
}

void Coverage::reset() {
  seen_.assign(points_.size(), 0);
  unseen_.resize(points_.size());
  std::iota(unseen_.begin(), unseen_.end(), 0U);
}

std::size_t Coverage::add(const DepthFrame& frame) {
  check_image(frame);
  const Look look(frame, options_, min_cosine_);
  const std::size_t before = unseen_.size();
  const auto is_seen = [&](std::uint32_t i) {
    if (look.sees(points_[i])) seen_[i] = 1;
    return seen_[i] != 0;
  };
  unseen_.erase(std::remove_if(unseen_.begin(), unseen_.end(), is_seen), unseen_.end());
  return before - unseen_.size();
}

void Coverage::sort_into_cells() {
  Eigen::AlignedBox3d box;
  for (const SurfacePoint& point : points_) box.extend(point.position);
  cells_.low = box.min();
  cells_.size = (box.sizes() / options_.surfel_distance).array().floor().cast<int>() + 1;
  const auto cell_of = [&](const SurfacePoint& point) {
    const Array3i cell = ((point.position - cells_.low) / options_.surfel_distance).array().floor().cast<int>();
    return cells_.index(cell.min(cells_.size - 1));
  };
  cells_.first.assign(static_cast<std::size_t>(cells_.size.cast<std::int64_t>().prod()) + 1, 0);
  for (const SurfacePoint& point : points_) ++cells_.first[cell_of(point) + 1];
  std::partial_sum(cells_.first.begin(), cells_.first.end(), cells_.first.begin());
  std::vector<std::uint32_t> next(cells_.first.begin(), cells_.first.end() - 1);
  cells_.points.resize(points_.size());
  for (std::uint32_t i = 0; i < points_.size(); ++i) cells_.points[next[cell_of(points_[i])]++] = i;
}

std::vector<std::uint8_t> Coverage::mapped(const std::vector<Surfel>& surfels) const {
  std::vector<std::uint8_t> mapped(points_.size(), 0);
  const double squared = options_.surfel_distance * options_.surfel_distance;
  for (const Surfel& surfel : surfels) {
    if (surfel.label != Label::kOccupied || !surfel.position.allFinite()) continue;
    const Vector3d p = surfel.position.cast<double>();
    const Eigen::Array3d at = ((p - cells_.low) / options_.surfel_distance).array().floor();
    if ((at < -1).any() || (at > cells_.size.cast<double>()).any()) continue;  // too far away for whole numbers, too
    const Array3i low = (at.cast<int>() - 1).max(0), high = (at.cast<int>() + 1).min(cells_.size - 1);
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        const std::uint32_t end = cells_.first[cells_.index({high.x(), y, z}) + 1];
        for (std::uint32_t k = cells_.first[cells_.index({low.x(), y, z})]; k < end; ++k) {
          const std::uint32_t i = cells_.points[k];
          if (!mapped[i] && (points_[i].position - p).squaredNorm() <= squared) mapped[i] = 1;
        }
      }
    }
  }
  return mapped;
}

double Coverage::mapped_share(const std::vector<Surfel>& surfels) const {
  const std::vector<std::uint8_t> is_mapped = mapped(surfels);
  return static_cast<double>(std::count(is_mapped.begin(), is_mapped.end(), 1)) / static_cast<double>(is_mapped.size());
}

}  // namespace frontier_surfels::replay
