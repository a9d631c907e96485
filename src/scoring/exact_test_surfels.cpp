#include "scoring/exact_test_surfels.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "scoring/parallel.hpp"

namespace frontier_surfels::scoring {

namespace {

constexpr double kProbeStep = 0.002;  // [m] between the probes along the normal
constexpr int kProbesPerSide = 25;    // 5 cm to either side

/// Side of the cubes whose surfels are judged together [m]: large enough to share the choice of views, small enough for it to leave out
/// most.
constexpr double kCellSize = 0.1;

using Indices = std::vector<std::uint32_t>;

bool is_finite(const Surfel& surfel) { return surfel.position.allFinite() && surfel.normal.allFinite() && std::isfinite(surfel.radius); }

/// How far from its centre a surfel is probed [m].
double reach(const Surfel& surfel) {
  const double farthest = std::max(kProbesPerSide * kProbeStep, kFrontProbe * std::abs(static_cast<double>(surfel.radius)));
  return farthest * surfel.normal.cast<double>().norm();
}

/// The views that may have seen something of a place, most useful first.
class LocalViews {
 public:
  LocalViews(const std::vector<ExactView>& views, const Eigen::Vector3d& centre, double radius) {
    for (const ExactView& view : views) {
      const Coverage coverage = view.coverage(centre, radius);
      if (coverage == Coverage::kNone) continue;
      views_.push_back(&view);
      if (coverage != Coverage::kAll) continue;
      all_known_ = true;
      return;
    }
  }

  bool known(const Eigen::Vector3d& p_world) {
    if (all_known_) return true;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      if (!views_[i]->sees(p_world)) continue;
      std::swap(views_[0], views_[i]);  // What sees one probe is likely to see the next.
      return true;
    }
    return false;
  }

 private:
  std::vector<const ExactView*> views_;
  bool all_known_ = false;
};

Verdict judge(const Surfel& surfel, LocalViews& views) {
  const Eigen::Vector3d p = surfel.position.cast<double>(), n = surfel.normal.cast<double>();
  const double r = surfel.radius;
  const bool back = views.known(p - kBackProbe * r * n), front = views.known(p + kFrontProbe * r * n);
  if (front) return back ? Verdict::kBuried : Verdict::kRight;
  return back ? Verdict::kFlipped : Verdict::kFloating;
}

/// Distance to the nearest unknown -> known step along +n [m]; infinite if there is none within 5 cm. A step's place is its middle.
double distance_to_boundary(const Surfel& surfel, LocalViews& views) {
  const Eigen::Vector3d p = surfel.position.cast<double>(), n = surfel.normal.cast<double>();
  bool known_ahead = views.known(p), known_behind = known_ahead;
  for (int i = 1; i <= kProbesPerSide; ++i) {
    const bool next_ahead = views.known(p + i * kProbeStep * n);
    if (!known_ahead && next_ahead) return (i - 0.5) * kProbeStep;
    known_ahead = next_ahead;
    const bool next_behind = views.known(p - i * kProbeStep * n);
    if (!next_behind && known_behind) return (i - 0.5) * kProbeStep;
    known_behind = next_behind;
  }
  return std::numeric_limits<double>::infinity();
}

void count(SurfelTally& tally, const Surfel& surfel, Verdict verdict, double distance) {
  const double voxel = surfel.radius / kNewRadius;
  ++tally.verdicts[static_cast<std::size_t>(verdict)];
  tally.within_1v += distance <= voxel;
  tally.within_2v += distance <= 2 * voxel;
  tally.beyond_2cm += distance > 0.02;
  tally.beyond_5cm += distance > 0.05;
}

/// A ball that holds every probe of the surfels.
LocalViews views_around(const std::vector<ExactView>& views, const std::vector<Surfel>& surfels, const std::uint32_t* first,
                        const std::uint32_t* last) {
  Eigen::AlignedBox3d box;
  for (const auto* i = first; i != last; ++i) box.extend(surfels[*i].position.cast<double>());
  double radius = 0;
  for (const auto* i = first; i != last; ++i) {
    radius = std::max(radius, (surfels[*i].position.cast<double>() - box.center()).norm() + reach(surfels[*i]));
  }
  return LocalViews(views, box.center(), radius);
}

/// Surfels in the order of the cells of a grid, and where each cell's begin.
struct Cells {
  Indices order;
  std::vector<std::size_t> begin;  ///< one more than there are cells
};

std::uint64_t cell_key(const Surfel& surfel) {
  constexpr int kBits = 21;
  constexpr double kHalf = 1 << (kBits - 1);  // Cells farther out than this share the outermost one.
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double cell = std::clamp(std::floor(surfel.position[axis] / kCellSize), -kHalf, kHalf - 1);
    key = key << kBits | static_cast<std::uint64_t>(cell + kHalf);
  }
  return key;
}

Cells sort_into_cells(const std::vector<Surfel>& surfels) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed;
  keyed.reserve(surfels.size());
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    if (is_finite(surfels[i])) keyed.emplace_back(cell_key(surfels[i]), static_cast<std::uint32_t>(i));
  }
  std::sort(keyed.begin(), keyed.end());
  Cells cells;
  cells.order.reserve(keyed.size());
  for (std::size_t i = 0; i < keyed.size(); ++i) {
    if (i == 0 || keyed[i].first != keyed[i - 1].first) cells.begin.push_back(i);
    cells.order.push_back(keyed[i].second);
  }
  cells.begin.push_back(keyed.size());
  return cells;
}

}  // namespace

SurfelTally judge_surfels(const std::vector<ExactView>& views, const std::vector<Surfel>& surfels, int threads,
                          const std::function<bool(double)>& progress, std::vector<Verdict>* verdicts) {
  const Cells cells = sort_into_cells(surfels);
  if (verdicts) verdicts->assign(surfels.size(), Verdict::kFloating);

  std::vector<SurfelTally> tallies(cells.begin.size() - 1);
  const auto judge_cell = [&](std::size_t cell) {
    const std::uint32_t* first = cells.order.data() + cells.begin[cell];
    const std::uint32_t* last = cells.order.data() + cells.begin[cell + 1];
    LocalViews local = views_around(views, surfels, first, last);
    for (const std::uint32_t* i = first; i != last; ++i) {
      const Verdict verdict = judge(surfels[*i], local);
      count(tallies[cell], surfels[*i], verdict, distance_to_boundary(surfels[*i], local));
      if (verdicts) (*verdicts)[*i] = verdict;
    }
  };
  parallel_for(tallies.size(), threads, judge_cell, progress);

  SurfelTally sum;
  for (const SurfelTally& tally : tallies) {
    for (std::size_t v = 0; v < sum.verdicts.size(); ++v) sum.verdicts[v] += tally.verdicts[v];
    sum.within_1v += tally.within_1v;
    sum.within_2v += tally.within_2v;
    sum.beyond_2cm += tally.beyond_2cm;
    sum.beyond_5cm += tally.beyond_5cm;
  }
  const std::size_t not_finite = surfels.size() - cells.order.size();
  sum.verdicts[static_cast<std::size_t>(Verdict::kFloating)] += not_finite;
  sum.beyond_2cm += not_finite;
  sum.beyond_5cm += not_finite;
  return sum;
}

}  // namespace frontier_surfels::scoring
