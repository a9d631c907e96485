#include "scoring/exact_test_boundary.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "scoring/parallel.hpp"
#include "scoring/surfel_tree.hpp"

namespace frontier_surfels::scoring {

namespace {

constexpr double kMarchStep = 0.01;       // [m]
constexpr double kBisectionWidth = 1e-5;  // [m]
constexpr double kSheetStep = 0.005;      // [m] Unknown sheets thinner than four of these are no boundary.
constexpr int kSheetSteps = 4;
constexpr double kLabelProbe = 0.003;       // [m] behind the boundary
constexpr double kSurfaceThickness = 0.03;  // [m]
constexpr double kLabelDistance = 0.02;     // [m] Farther surfels do not speak for a boundary point.
constexpr std::size_t kSegmentsPerBlock = 64;

struct Segment {
  Eigen::Vector3d start, direction;  ///< world; start [m] was seen by a view, direction is a unit vector
};

/// Uniform numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  /// In [0, 1).
  double share() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  /// In 0 ... count - 1.
  std::size_t index(std::size_t count) { return std::min(static_cast<std::size_t>(share() * count), count - 1); }
  Eigen::Vector3d direction() {
    const double z = 2 * share() - 1, angle = 2 * M_PI * share();
    const double radius = std::sqrt(1 - z * z);
    return {radius * std::cos(angle), radius * std::sin(angle), z};
  }

 private:
  std::mt19937_64 engine_;
};

std::vector<Segment> draw_segments(const std::vector<ExactView>& views, std::size_t count, std::uint64_t seed) {
  std::vector<const ExactView*> candidates;
  for (const ExactView& view : views) {
    if (view.has_measurements()) candidates.push_back(&view);
  }
  std::vector<Segment> segments;
  if (candidates.empty()) return segments;
  segments.reserve(count);
  Random random(seed);
  while (segments.size() < count) {
    const ExactView& view = *candidates[random.index(candidates.size())];
    int s, t;
    do {
      s = static_cast<int>(random.index(view.width()));
      t = static_cast<int>(random.index(view.height()));
    } while (view.depth(s, t) == 0);
    const double z = (0.02 + 0.96 * random.share()) * view.depth(s, t);
    const Eigen::Vector3d start = view.on_ray(s, t, z);
    segments.push_back({start, random.direction()});
  }
  return segments;
}

/// The exact test along segments: it remembers which view was the last to see a point, since that one is likely to see the next.
class Marcher {
 public:
  Marcher(const std::vector<ExactView>& views, double max_length) : views_(views), max_length_(max_length) {}

  std::optional<BoundaryPoint> boundary_along(const Segment& segment) {
    const auto at = [&](double t) -> Eigen::Vector3d { return segment.start + t * segment.direction; };
    double inside, outside;
    if (is_void(segment.start) || !bracket(at, inside, outside)) return {};
    while (outside - inside > kBisectionWidth) {
      const double middle = (inside + outside) / 2;
      (known(at(middle)) ? inside : outside) = middle;
    }
    const double end = (inside + outside) / 2;
    for (int i = 1; i <= kSheetSteps; ++i) {
      if (known(at(end + i * kSheetStep))) return {};
    }
    const bool occupied = just_behind_surface(at(end + kLabelProbe));
    if (!occupied && is_void(at(outside))) return {};  // a face of something new that nobody has seen yet
    return BoundaryPoint{at(end), occupied};
  }

 private:
  /// The first march step that leaves known space.
  template <typename At>
  bool bracket(const At& at, double& inside, double& outside) {
    const int steps = static_cast<int>(std::floor(max_length_ / kMarchStep + 1e-6));
    for (int i = 1; i <= steps; ++i) {
      if (known(at(i * kMarchStep))) continue;
      inside = (i - 1) * kMarchStep;
      outside = i * kMarchStep;
      return true;
    }
    return false;
  }

  bool known(const Eigen::Vector3d& p_world) {
    if (views_[last_seer_].sees(p_world)) return true;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      if (!views_[i].sees(p_world)) continue;
      last_seer_ = i;
      return true;
    }
    return false;
  }

  /// Whether the point is unknown only because something was put there.
  bool is_void(const Eigen::Vector3d& p_world) {
    return !known(p_world) && std::any_of(views_.begin(), views_.end(), [&](const ExactView& view) { return view.saw(p_world); });
  }

  bool just_behind_surface(const Eigen::Vector3d& p_world) const {
    return std::any_of(views_.begin(), views_.end(),
                       [&](const ExactView& view) { return view.sees_just_behind_surface(p_world, kSurfaceThickness); });
  }

  const std::vector<ExactView>& views_;
  double max_length_;
  std::size_t last_seer_ = 0;
};

}  // namespace

std::vector<BoundaryPoint> find_boundary(const std::vector<ExactView>& views, double z_max, std::size_t segments, std::uint64_t seed,
                                         int threads, const std::function<bool(double)>& progress) {
  const std::vector<Segment> drawn = draw_segments(views, segments, seed);
  std::vector<std::optional<BoundaryPoint>> found(drawn.size());
  const auto march_block = [&](std::size_t block) {
    Marcher marcher(views, 2 * z_max);
    const std::size_t end = std::min((block + 1) * kSegmentsPerBlock, drawn.size());
    for (std::size_t i = block * kSegmentsPerBlock; i < end; ++i) found[i] = marcher.boundary_along(drawn[i]);
  };
  parallel_for((drawn.size() + kSegmentsPerBlock - 1) / kSegmentsPerBlock, threads, march_block, progress);

  std::vector<BoundaryPoint> boundary;
  for (const auto& point : found) {
    if (point) boundary.push_back(*point);
  }
  return boundary;
}

void judge_completeness(const std::vector<BoundaryPoint>& boundary, const std::vector<Surfel>& surfels, ExactScore& score) {
  score.boundary_points = boundary.size();
  if (boundary.empty()) return;
  const SurfelTree tree(surfels);
  std::size_t missed_1cm = 0, missed_2cm = 0, missed_5cm = 0, label_right = 0;
  for (const BoundaryPoint& point : boundary) {
    const auto [surfel, distance] = tree.nearest(point.position);
    missed_1cm += distance > 0.01;
    missed_2cm += distance > 0.02;
    missed_5cm += distance > 0.05;
    if (distance <= kLabelDistance) label_right += (surfel->label == Label::kOccupied) == point.occupied;
  }
  const double all = static_cast<double>(boundary.size());
  score.miss_1cm = missed_1cm / all;
  score.miss_2cm = missed_2cm / all;
  score.miss_5cm = missed_5cm / all;
  const std::size_t labelled = boundary.size() - missed_2cm;
  score.label_ok = labelled > 0 ? static_cast<double>(label_right) / labelled : 0;
}

}  // namespace frontier_surfels::scoring
