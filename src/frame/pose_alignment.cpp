#include "frame/pose_alignment.hpp"

#include <algorithm>
#include <cmath>

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

/// A point on a surface that the frame has measured, in its own camera's frame.
struct Point {
  Eigen::Vector3f position;
  Eigen::Vector3f normal;  ///< unit; its sign does not matter
  float variance;          ///< of a distance along the ray, of this point and the reference's together [m^2]
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

  std::vector<Point> points(std::size_t number) const {
    const auto steps = static_cast<std::size_t>(step_);
    const int first_t = static_cast<int>(number % steps), first_s = static_cast<int>(number / steps % steps);
    std::vector<Point> points;
    for (int t = first_t; t < camera_.height; t += step_)
      for (int s = first_s; s < camera_.width; s += step_)
        if (const auto point = point_at(s, t)) points.push_back(*point);
    return points;
  }

 private:
  float depth(int s, int t) const { return image_.depth[static_cast<std::size_t>(t) * camera_.width + s]; }

  std::optional<Point> point_at(int s, int t) const {
    const int b = baseline_;
    if (s < b || t < b || s + b >= camera_.width || t + b >= camera_.height) return std::nullopt;
    const float here = depth(s, t), left = depth(s - b, t), right = depth(s + b, t), above = depth(s, t - b), below = depth(s, t + b);
    const auto [nearest, farthest] = std::minmax({here, left, right, above, below});
    if (!(nearest > 0 && farthest - nearest <= kSmooth * nearest)) return std::nullopt;
    const Eigen::Vector3f normal = (camera_.point(s + b, t, right) - camera_.point(s - b, t, left))
                                       .cross(camera_.point(s, t + b, below) - camera_.point(s, t - b, above));
    const float length = normal.norm(), sigma = sigma_of(here, config_);
    if (!(length > 0)) return std::nullopt;
    return Point{camera_.point(s, t, here), normal / length, 2 * sigma * sigma};
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
  Eigen::Matrix3f R_camera_reference;
  const float* inverse_depth;
};

/// The inverse depth of a reference at an image point, between its four pixels. 0: they do not measure one surface
float inverse_depth_at(const float* inverse_depth, const Pinhole& camera, float u, float v) {
  if (!(u >= 0 && v >= 0 && u < static_cast<float>(camera.width - 1) && v < static_cast<float>(camera.height - 1))) return 0;
  const int s = static_cast<int>(u), t = static_cast<int>(v);
  const float* upper = inverse_depth + static_cast<std::size_t>(t) * camera.width + s;
  const float* lower = upper + camera.width;
  const float low = std::min({upper[0], upper[1], lower[0], lower[1]}), high = std::max({upper[0], upper[1], lower[0], lower[1]});
  if (!(low > 0 && high - low <= kFlat * low)) return 0;
  const float right = u - static_cast<float>(s), down = v - static_cast<float>(t);
  return (1 - down) * ((1 - right) * upper[0] + right * upper[1]) + down * ((1 - right) * lower[0] + right * lower[1]);
}

/// Sums of a least squares problem.
struct Sums {
  Matrix6d A = Matrix6d::Zero();  ///< of w J J^T; the lower triangle
  Vector6d b = Vector6d::Zero();  ///< of w e J
  std::size_t distances = 0;
};

/// One iteration of the least squares, at a guessed pose.
class Equations {
 public:
  Equations(const std::vector<Point>& points, const std::vector<const ReferenceFrame*>& references, const Pinhole& camera,
            const Eigen::Isometry3d& guess, double reach)
      : points_(points), camera_(camera), R_world_camera_(guess.linear().cast<float>()), reach_(static_cast<float>(reach)) {
    for (const ReferenceFrame* reference : references) {
      const Eigen::Isometry3d T_reference_camera = reference->T_world_camera.inverse(Eigen::Isometry) * guess;
      const Eigen::Matrix3f R = T_reference_camera.linear().cast<float>();
      targets_.push_back({R, T_reference_camera.translation().cast<float>(), R.transpose(), reference->inverse_depth.data()});
    }
  }

  Sums sums() const {
    Sums sums;
    for (const Point& point : points_) add(point, sums);
    return sums;
  }

 private:
  /// The point's Jacobian is the same for all references.
  void add(const Point& point, Sums& sums) const {
    float weight = 0, weighted = 0;
    std::size_t distances = 0;
    for (const Target& target : targets_) distances += add_distance(point, target, weight, weighted);
    if (distances == 0) return;
    const Eigen::Vector3f normal = R_world_camera_ * point.normal, arm = R_world_camera_ * point.position;
    Vector6d J;
    J << normal.cast<double>(), arm.cross(normal).cast<double>();
    sums.A.selfadjointView<Eigen::Lower>().rankUpdate(J, weight);
    sums.b += static_cast<double>(weighted) * J;
    sums.distances += distances;
  }

  /// @return 1 if the distance from this reference counts
  std::size_t add_distance(const Point& point, const Target& target, float& weight, float& weighted) const {
    const Eigen::Vector3f p = target.R_reference_camera * point.position + target.t_reference_camera;
    if (!(p.z() > 0.1F)) return 0;
    const float x = p.x() / p.z(), y = p.y() / p.z();
    const float inverse = inverse_depth_at(target.inverse_depth, camera_, camera_.fx * x + camera_.cx, camera_.fy * y + camera_.cy);
    if (inverse == 0) return 0;
    const float along_ray = 1 / inverse - p.z();
    if (!(std::abs(along_ray) <= kGate * p.z())) return 0;
    const float cosine = point.normal.dot(target.R_camera_reference * Eigen::Vector3f(x, y, 1));
    const float distance = cosine * along_ray, share = distance / reach_;
    if (!(std::abs(cosine) > kLeastCosine && std::abs(share) < 1)) return 0;
    const float robust = (1 - share * share) * (1 - share * share);
    const float w = robust / (point.variance * cosine * cosine + kLeastError * kLeastError);
    weight += w;
    weighted += w * distance;
    return 1;
  }

  const std::vector<Point>& points_;
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

std::vector<float> inverse_depths(const WorkingImage& image) {
  std::vector<float> inverse;
  inverse.reserve(image.depth.size());
  for (const float depth : image.depth) inverse.push_back(depth > 0 ? 1 / depth : 0);
  return inverse;
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
  const std::vector<Point> points = PointGrid(image, config).points(number);
  const Pinhole camera(image.intrinsics);
  const std::size_t least = std::max(kLeastDistances, points.size() * references.size() / kLeastPart);
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
