#include "frame/pose_alignment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "frame/wide_vectors.hpp"

namespace frontier_surfels {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kPoints = 800;                       // of an image
constexpr float kSmooth = 0.06F;                      // share by which the depths around a point may differ: else it has no normal
constexpr float kFlat = 0.03F;                        // share by which the four pixels around a point in a reference may differ
constexpr float kGate = 0.05F;                        // share of the depth by which a point may lie off a reference's surface
constexpr float kLeastCosine = 0.15F;                 // between a point's normal and a reference's ray, with which the distance is measured
constexpr float kLeastError = 0.002F;                 // [m] of a distance, besides the noise
constexpr double kFirstReach = 0.03, kReach = 0.015;  // [m] distances beyond this do not count: in the first iteration, and then
constexpr int kIterations = 3;                        // at most
constexpr double kStillShift = 1e-4, kStillTurn = 5e-5;       // [m], [rad] smaller steps end the iterations
constexpr std::size_t kLeastDistances = 300, kLeastPart = 4;  // so many, and a quarter of those that there can be
constexpr double kIndependent = 1.0 / 16;  // share of the distances whose errors are their own: all references see the frame's own errors

constexpr std::size_t kBatch = 64;  // points, of which as many numbers fit into a processor's fastest memory

/// A number of each point of a batch.
using Numbers = std::array<float, kBatch>;
using Vectors = std::array<Numbers, 3>;  ///< x, y, z

/// Points on surfaces that the frame has measured, in its own camera's frame. Their numbers lie side by side, so that the compiler makes
/// vectors of loops over them.
struct Batch {
  std::size_t count = 0;  ///< points; the positions of all others are NaN, with which nothing counts
  Vectors position;
  Vectors normal;    ///< unit; its sign does not matter
  Numbers variance;  ///< of a distance along the ray, of this point and the reference's together [m^2]
};

/// Points in batches.
class Points {
 public:
  void add(const Eigen::Vector3f& position, const Eigen::Vector3f& normal, float variance) {
    if (batches_.empty() || batches_.back().count == kBatch) batches_.push_back(blank());
    Batch& batch = batches_.back();
    for (int axis = 0; axis < 3; ++axis) {
      batch.position[axis][batch.count] = position[axis];
      batch.normal[axis][batch.count] = normal[axis];
    }
    batch.variance[batch.count++] = variance;
    ++count_;
  }

  const std::vector<Batch>& batches() const { return batches_; }
  std::size_t count() const { return count_; }

 private:
  static Batch blank() {
    Batch batch;
    for (Vectors* vectors : {&batch.position, &batch.normal})
      for (Numbers& numbers : *vectors) numbers.fill(std::numeric_limits<float>::quiet_NaN());
    batch.variance.fill(1);
    return batch;
  }

  std::vector<Batch> batches_;
  std::size_t count_ = 0;
};

struct Pinhole {
  explicit Pinhole(const Intrinsics& k)
      : fx(static_cast<float>(k.fx)),
        fy(static_cast<float>(k.fy)),
        cx(static_cast<float>(k.cx)),
        cy(static_cast<float>(k.cy)),
        width(k.width),
        height(k.height) {}
  Eigen::Vector3f point(int s, int t, float depth) const {
    return {(static_cast<float>(s) - cx) / fx * depth, (static_cast<float>(t) - cy) / fy * depth, depth};
  }
  float fx, fy, cx, cy;
  int width, height;
};

/// Standard deviation of a working pixel's depth [m]. The errors of the pixels of a mean are not independent, so that it has a third of
/// one pixel's.
float sigma_of(float depth, const Config& config) {
  const double pixel = config.noise + config.noise_growth * depth * depth;
  return static_cast<float>(config.sampling == "mean" && config.decimation > 1 ? pixel / 3 : pixel);
}

/// Points at every `step`-th column and row.
class PointGrid {
 public:
  PointGrid(const WorkingImage& image, const Config& config) : image_(image), camera_(image.intrinsics), config_(config) {
    const double area = static_cast<double>(camera_.width) * camera_.height;
    step_ = std::max(1, static_cast<int>(std::ceil(std::sqrt(area / kPoints))));
    baseline_ = std::max(1, step_ / 4);
  }

  Points points(std::size_t number) const {
    const auto steps = static_cast<std::size_t>(step_);
    const int first_t = static_cast<int>(number % steps), first_s = static_cast<int>(number / steps % steps);
    Points points;
    for (int t = first_t; t < camera_.height; t += step_)
      for (int s = first_s; s < camera_.width; s += step_) add_point(s, t, points);
    return points;
  }

 private:
  float depth(int s, int t) const { return image_.depth[static_cast<std::size_t>(t) * camera_.width + s]; }

  void add_point(int s, int t, Points& points) const {
    const int b = baseline_;
    if (s < b || t < b || s + b >= camera_.width || t + b >= camera_.height) return;
    const float here = depth(s, t), left = depth(s - b, t), right = depth(s + b, t), above = depth(s, t - b), below = depth(s, t + b);
    const auto [nearest, farthest] = std::minmax({here, left, right, above, below});
    if (!(nearest > 0 && farthest - nearest <= kSmooth * nearest)) return;
    const Eigen::Vector3f normal = (camera_.point(s + b, t, right) - camera_.point(s - b, t, left))
                                       .cross(camera_.point(s, t + b, below) - camera_.point(s, t - b, above));
    const float length = normal.norm(), sigma = sigma_of(here, config_);
    if (length > 0) points.add(camera_.point(s, t, here), normal / length, 2 * sigma * sigma);
  }

  const WorkingImage& image_;
  Pinhole camera_;
  const Config& config_;
  int step_, baseline_;
};

/// A reference as the frame's camera sees it at a guessed pose.
struct Target {
  Eigen::Matrix3f R_reference_camera;
  Eigen::Vector3f t_reference_camera;
  const float* inverse_depth;
};

/// The points of a batch as a reference sees them. Where the image does not have them, `inside` is 0, and the pixel is the first one.
struct Seen {
  Numbers x, y, z;      ///< x, y: of the ray with depth 1; z: depth [m]
  Numbers right, down;  ///< of the pixel, in the image
  std::array<int, kBatch> pixel, inside;
};

/// The product of a row of a matrix, or of a column, and a vector. The order of the sum is Eigen's.
float product(const Eigen::Vector3f& row, float x, float y, float z) { return row[0] * x + (row[1] * y + row[2] * z); }

WIDE_VECTORS void project(const Batch& batch, const Target& target, const Pinhole& camera, Seen& seen) {
  const Eigen::Matrix3f R = target.R_reference_camera.transpose();  // its columns are the rows
  const Eigen::Vector3f t = target.t_reference_camera;
  const Eigen::Vector3f row_x = R.col(0), row_y = R.col(1), row_z = R.col(2);
  const float last_u = static_cast<float>(camera.width - 1), last_v = static_cast<float>(camera.height - 1);
  const auto& [px, py, pz] = batch.position;
  for (std::size_t n = 0; n < kBatch; ++n) {
    const float z = product(row_z, px[n], py[n], pz[n]) + t.z();
    const float x = (product(row_x, px[n], py[n], pz[n]) + t.x()) / z, y = (product(row_y, px[n], py[n], pz[n]) + t.y()) / z;
    const float u = camera.fx * x + camera.cx, v = camera.fy * y + camera.cy;
    const int inside = (z > 0.1F ? 1 : 0) & (u >= 0 ? 1 : 0) & (v >= 0 ? 1 : 0) & (u < last_u ? 1 : 0) & (v < last_v ? 1 : 0);
    const float column = inside != 0 ? u : 0, row = inside != 0 ? v : 0;
    const int s = static_cast<int>(column), t_row = static_cast<int>(row);
    seen.x[n] = x;
    seen.y[n] = y;
    seen.z[n] = z;
    seen.right[n] = column - static_cast<float>(s);
    seen.down[n] = row - static_cast<float>(t_row);
    seen.pixel[n] = t_row * camera.width + s;
    seen.inside[n] = inside;
  }
}

/// The inverse depths of a reference at the points of a batch, between their four pixels. 0: these do not measure one surface
WIDE_VECTORS void find_inverse_depths(const Seen& seen, const float* inverse_depth, int width, Numbers& inverse) {
  std::array<Numbers, 4> corners;  // upper left, upper right, lower left, lower right
  for (std::size_t n = 0; n < kBatch; ++n) {
    const float* upper = inverse_depth + seen.pixel[n];
    corners[0][n] = upper[0];
    corners[1][n] = upper[1];
    corners[2][n] = upper[width];
    corners[3][n] = upper[width + 1];
  }
  for (std::size_t n = 0; n < kBatch; ++n) {
    const float a = corners[0][n], b = corners[1][n], c = corners[2][n], d = corners[3][n], right = seen.right[n], down = seen.down[n];
    const float low = std::min(std::min(a, b), std::min(c, d)), high = std::max(std::max(a, b), std::max(c, d));
    const int is_surface = seen.inside[n] & (low > 0 ? 1 : 0) & (high - low <= kFlat * low ? 1 : 0);
    const float between = (1 - down) * ((1 - right) * a + right * b) + down * ((1 - right) * c + right * d);
    inverse[n] = is_surface != 0 ? between : 0;
  }
}

/// Sums of a least squares problem.
struct Sums {
  Matrix6d A = Matrix6d::Zero();  ///< of w J J^T; its lower triangle counts, as rounding differs above
  Vector6d b = Vector6d::Zero();  ///< of w e J
  std::size_t distances = 0;
};

/// One iteration of the least squares, at a guessed pose.
class Equations {
 public:
  Equations(const Points& points, const std::vector<const ReferenceFrame*>& references, const Pinhole& camera,
            const Eigen::Isometry3d& guess, double reach)
      : points_(points), camera_(camera), R_world_camera_(guess.linear().cast<float>()), reach_(static_cast<float>(reach)) {
    if (camera.width < 2 || camera.height < 2) return;  // no point lies between four pixels
    for (const ReferenceFrame* reference : references) {
      const Eigen::Isometry3d T_reference_camera = reference->T_world_camera.inverse(Eigen::Isometry) * guess;
      targets_.push_back(
          {T_reference_camera.linear().cast<float>(), T_reference_camera.translation().cast<float>(), reference->inverse_depth.data()});
    }
  }

  Sums sums() const {
    Sums sums;
    for (const Batch& batch : points_.batches()) add(batch, sums);
    return sums;
  }

 private:
  /// Of each point of a batch: sums over the references.
  struct Weights {
    Numbers weight = {}, weighted = {};
    std::array<int, kBatch> distances = {};
  };

  void add(const Batch& batch, Sums& sums) const {
    Weights weights;
    for (const Target& target : targets_) weigh(batch, target, weights);
    for (std::size_t n = 0; n < batch.count; ++n)
      if (weights.distances[n] > 0) add_point(batch, n, weights, sums);
  }

  /// Adds the distances of the points from a reference, where they count.
  WIDE_VECTORS void weigh(const Batch& batch, const Target& target, Weights& weights) const {
    Seen seen;
    Numbers inverse;
    project(batch, target, camera_, seen);
    find_inverse_depths(seen, target.inverse_depth, camera_.width, inverse);
    const Eigen::Matrix3f R = target.R_reference_camera;  // its columns are the rows of R_camera_reference
    const Eigen::Vector3f row_x = R.col(0), row_y = R.col(1), row_z = R.col(2);
    const float reach = reach_;
    for (std::size_t n = 0; n < kBatch; ++n) {
      const float x = seen.x[n], y = seen.y[n], z = seen.z[n], along_ray = 1 / inverse[n] - z;
      const float ray_x = product(row_x, x, y, 1), ray_y = product(row_y, x, y, 1), ray_z = product(row_z, x, y, 1);
      const float cosine = batch.normal[0][n] * ray_x + (batch.normal[1][n] * ray_y + batch.normal[2][n] * ray_z);
      const float distance = cosine * along_ray, share = distance / reach;
      const int counts = (inverse[n] > 0 ? 1 : 0) & (std::abs(along_ray) <= kGate * z ? 1 : 0) & (std::abs(cosine) > kLeastCosine ? 1 : 0) &
                         (std::abs(share) < 1 ? 1 : 0);
      const float robust = (1 - share * share) * (1 - share * share);
      const float w = robust / (batch.variance[n] * cosine * cosine + kLeastError * kLeastError);
      weights.weight[n] += counts != 0 ? w : 0;
      weights.weighted[n] += counts != 0 ? w * distance : 0;
      weights.distances[n] += counts;
    }
  }

  /// The point's Jacobian is the same for all references.
  void add_point(const Batch& batch, std::size_t n, const Weights& weights, Sums& sums) const {
    const auto of_point = [n](const Vectors& vectors) { return Eigen::Vector3f(vectors[0][n], vectors[1][n], vectors[2][n]); };
    const Eigen::Vector3f normal = R_world_camera_ * of_point(batch.normal), arm = R_world_camera_ * of_point(batch.position);
    Vector6d J;
    J << normal.cast<double>(), arm.cross(normal).cast<double>();
    const double weight = weights.weight[n], weighted = weights.weighted[n];
    for (int column = 0; column < 6; ++column) sums.A.col(column) += weight * J[column] * J;
    sums.b += weighted * J;
    sums.distances += static_cast<std::size_t>(weights.distances[n]);
  }

  const Points& points_;
  const Pinhole& camera_;
  Eigen::Matrix3f R_world_camera_;
  float reach_;
  std::vector<Target> targets_;
};

/// The next step from the guess. @param recorded  the motion from there to the recorded pose
Motion solve(const Sums& sums, const Motion& recorded) {
  Vector6d prior, from_prior;
  prior << Eigen::Vector3d::Constant(1 / (kShiftError * kShiftError)), Eigen::Vector3d::Constant(1 / (kTurnError * kTurnError));
  from_prior << recorded.shift, recorded.turn;
  Matrix6d A = kIndependent * Matrix6d(sums.A.selfadjointView<Eigen::Lower>());
  A.diagonal() += prior;
  const Vector6d x = A.ldlt().solve(kIndependent * sums.b + prior.cwiseProduct(from_prior));
  return {x.head<3>(), x.tail<3>()};
}

}  // namespace

WIDE_VECTORS std::vector<float> inverse_depths(const WorkingImage& image, std::vector<float> room) {
  room.resize(image.depth.size());
  std::transform(image.depth.begin(), image.depth.end(), room.begin(), [](float depth) {
    const float inverse_depth = 1 / depth;
    return depth > 0 ? inverse_depth : 0;
  });
  return room;
}

/// Without sines, whose last bits are not the same on all machines.
Eigen::Isometry3d moved(const Eigen::Isometry3d& T, const Motion& motion, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d half = motion.turn / 2;
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(1, half.x(), half.y(), half.z()).normalized();
  Eigen::Isometry3d result = T;
  result.linear() = (rotation * Eigen::Quaterniond(T.linear())).normalized().toRotationMatrix();
  result.translation() = centre + rotation * (T.translation() - centre) + motion.shift;
  return result;
}

Motion motion_between(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, const Eigen::Vector3d& centre) {
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(to.linear()) * Eigen::Quaterniond(from.linear()).conjugate();
  return {to.translation() - centre - rotation * (from.translation() - centre), 2 / rotation.w() * rotation.vec()};
}

std::optional<Eigen::Isometry3d> align(const WorkingImage& image, const Eigen::Isometry3d& T_world_camera,
                                       const std::vector<const ReferenceFrame*>& references, std::size_t number, const Config& config) {
  const Points points = PointGrid(image, config).points(number);
  const Pinhole camera(image.intrinsics);
  const std::size_t least = std::max(kLeastDistances, points.count() * references.size() / kLeastPart);
  Eigen::Isometry3d pose = T_world_camera;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Sums sums = Equations(points, references, camera, pose, iteration == 0 ? kFirstReach : kReach).sums();
    if (sums.distances < least) return std::nullopt;
    const Eigen::Vector3d centre = pose.translation();
    const Motion step = solve(sums, motion_between(pose, T_world_camera, centre));
    pose = moved(pose, step, centre);
    if (step.shift.cwiseAbs().maxCoeff() < kStillShift && step.turn.cwiseAbs().maxCoeff() < kStillTurn) break;
  }
  return pose;
}

}  // namespace frontier_surfels
