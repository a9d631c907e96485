#include "planner/box_states.hpp"

#include <algorithm>
#include <string>

#include "config/config_text.hpp"
#include "frontier_surfels/types.hpp"
#include "planner/box_lattice.hpp"
#include "planner/regions.hpp"

namespace frontier_surfels {
namespace {

constexpr float kLargest = 20;  // edge of a box [m]
constexpr std::size_t kPointsAtOnce = std::size_t{1} << 20;
constexpr std::size_t kPositionsAtOnce = 16;  // of a box on its path: many are stopped early
constexpr double kFarthestAtOnce = 4;         // they may go so far, or one step [m]
constexpr double kMostPositions = 1e6;        // of a path

void check_step(double step) {
  if (!(step >= 0.001 && step <= 1)) throw Error("The step within boxes is " + to_text(step) + " m: it must be from 0.001 to 1 m.");
}

void check_size(const std::string& what, const Eigen::Vector3f& size) {
  if (!(size.minCoeff() > 0 && size.maxCoeff() <= kLargest))
    throw Error(what + " is " + to_text(size.x()) + " x " + to_text(size.y()) + " x " + to_text(size.z()) +
                " m large: each edge must be longer than 0, and at most 20 m.");
}

void check_samples(double count, double step) {
  if (count > kMostAsked)
    throw Error("A step of " + to_text(step) + " m makes more than 100 million samples: choose a larger one, or ask for less at once.");
}

/// The first sample, from `begin` to `end`, that is occupied, or unknown if that counts.
std::vector<SpaceState>::const_iterator first_stop(std::vector<SpaceState>::const_iterator begin,
                                                   std::vector<SpaceState>::const_iterator end, bool unknown_counts) {
  return std::find_if(begin, end, [=](SpaceState s) { return ends_ray(s, unknown_counts); });
}

/// What there is in a part of a box.
SpaceState joined(std::vector<SpaceState>::const_iterator begin, std::vector<SpaceState>::const_iterator end, SpaceState before) {
  if (before == SpaceState::kOccupied || first_stop(begin, end, false) != end) return SpaceState::kOccupied;
  return first_stop(begin, end, true) != end ? SpaceState::kUnknown : before;
}

/// A box on its way. Positions are at most a step apart; both ends of the path count.
class Walk {
 public:
  Walk(std::size_t number, const Ray& path, double step)
      : number_(number),
        path_(path),
        way_(path.to - path.from),
        length_(way_.norm()),
        positions_(static_cast<std::size_t>(std::ceil(way_.cast<double>().norm() / step)) + 1) {}

  std::size_t number() const { return number_; }
  std::size_t positions() const { return positions_; }
  const Eigen::Vector3f& way() const { return way_; }
  bool at_end() const { return next_ == positions_; }
  std::size_t next() const { return next_; }
  void go_to(std::size_t position) { next_ = position; }

  /// Length of the way to a position, or to a share of the way between two [m].
  float distance(double position) const { return positions_ == 1 ? 0 : length_ * static_cast<float>(position / (positions_ - 1.0)); }
  Eigen::Vector3f centre(std::size_t n) const {
    if (n + 1 == positions_) return path_.to;
    return path_.from + way_ * (static_cast<float>(n) / static_cast<float>(positions_ - 1));
  }

 private:
  std::size_t number_;  ///< of the path
  Ray path_;
  Eigen::Vector3f way_;
  float length_;           ///< [m]
  std::size_t positions_;  ///< on the path
  std::size_t next_ = 0;   ///< position that has not been asked for
};

/// The next positions of some walks, asked for at once.
class Round {
 public:
  Round(const BoxLattice& lattice, const Eigen::Vector3f& half_size, std::size_t positions)
      : lattice_(lattice), half_size_(half_size), positions_(positions) {}

  bool is_full() const { return points_.size() >= kPointsAtOnce; }

  void add(Walk& walk) {
    Leg leg = {&walk, walk.next(), std::min(walk.next() + positions_, walk.positions()), {points_.size()}};
    for (std::size_t n = leg.begin; n < leg.end; ++n) {
      const Eigen::Vector3f low = walk.centre(n) - half_size_;
      n == 0 ? lattice_.append(low, points_) : lattice_.append_front(walk.way(), low, points_);
      leg.points.push_back(points_.size());
    }
    boxes_.push_back({walk.centre(leg.surfels_from()), walk.centre(leg.end - 1), half_size_});
    walk.go_to(leg.end);
    legs_.push_back(std::move(leg));
  }

  /// Writes the states of walks that are stopped, and ends these.
  void ask(bool stop_at_unknown, const StatesOf& states_of, const FirstWithin& first_within, std::vector<RayState>& states) const {
    const std::vector<SpaceState> found = states_of(points_);
    const std::vector<FirstSurfel> surfels = first_within(boxes_, stop_at_unknown);
    for (std::size_t n = 0; n < legs_.size(); ++n) {
      const auto [state, position] = stop_of(legs_[n], found, surfels[n], stop_at_unknown);
      if (state == SpaceState::kFree) continue;
      Walk& walk = *legs_[n].walk;
      states[walk.number()] = {state, walk.distance(position)};
      walk.go_to(walk.positions());
    }
  }

 private:
  struct Leg {
    Walk* walk;
    std::size_t begin, end;           ///< positions
    std::vector<std::size_t> points;  ///< first of each position, and one past the last

    /// Position from which surfels are looked for: where the last leg has ended.
    std::size_t surfels_from() const { return begin == 0 ? 0 : begin - 1; }
  };

  struct Stop {
    SpaceState state = SpaceState::kFree;
    double position = 0;
  };

  static Stop stop_of(const Leg& leg, const std::vector<SpaceState>& found, const FirstSurfel& surfel, bool stop_at_unknown) {
    Stop stop;
    if (surfel.share <= 1) {
      const double from = leg.surfels_from(), positions = leg.end - 1 - from;
      stop = {surfel.label == Label::kOccupied ? SpaceState::kOccupied : SpaceState::kUnknown, from + surfel.share * positions};
    }
    const auto at = [&](std::size_t point) { return found.begin() + static_cast<std::ptrdiff_t>(point); };
    const auto first = first_stop(at(leg.points.front()), at(leg.points.back()), stop_at_unknown);
    if (first == at(leg.points.back())) return stop;
    const auto next = std::upper_bound(leg.points.begin(), leg.points.end(), static_cast<std::size_t>(first - found.begin()));
    const auto n = static_cast<std::size_t>(next - leg.points.begin()) - 1;
    const double position = static_cast<double>(leg.begin + n);
    if (stop.state != SpaceState::kFree && stop.position < position) return stop;
    const SpaceState here = joined(at(leg.points[n]), at(leg.points[n + 1]), SpaceState::kUnknown);
    const bool surfel_as_soon = stop.state == SpaceState::kOccupied && stop.position == position;
    return {surfel_as_soon ? SpaceState::kOccupied : here, position};
  }

  const BoxLattice& lattice_;
  Eigen::Vector3f half_size_;
  std::size_t positions_;  ///< that a walk makes at most
  std::vector<Leg> legs_;
  std::vector<Eigen::Vector3f> points_;
  std::vector<MovingBox> boxes_;
};

}  // namespace

std::vector<SpaceState> box_states(const std::vector<Eigen::AlignedBox3f>& boxes_world, double step, const StatesOf& states_of,
                                   const FirstWithin& first_within) {
  check_step(step);
  double samples = 0;
  std::vector<MovingBox> boxes;
  for (std::size_t n = 0; n < boxes_world.size(); ++n) {
    const Eigen::AlignedBox3f& box = boxes_world[n];
    if (!box.min().allFinite() || !box.max().allFinite()) throw Error("Box " + std::to_string(n) + " has a corner that is not finite.");
    check_size("Box " + std::to_string(n), box.sizes());
    samples += BoxLattice(box.sizes(), step).points();
    boxes.push_back({box.center(), box.center(), box.sizes() / 2});
  }
  check_samples(samples, step);

  std::vector<SpaceState> states;
  for (const FirstSurfel& surfel : first_within(boxes, true))
    states.push_back(surfel.share > 1                   ? SpaceState::kFree
                     : surfel.label == Label::kOccupied ? SpaceState::kOccupied
                                                        : SpaceState::kUnknown);
  for (std::size_t begin = 0, end = 0; begin < states.size(); begin = end) {
    std::vector<Eigen::Vector3f> points;
    std::vector<std::size_t> points_end;
    for (; end < states.size() && points.size() < kPointsAtOnce; ++end) {
      if (states[end] != SpaceState::kOccupied) BoxLattice(boxes_world[end].sizes(), step).append(boxes_world[end].min(), points);
      points_end.push_back(points.size());
    }
    const std::vector<SpaceState> found = states_of(points);
    auto at = found.begin();
    for (std::size_t n = begin; n < end; ++n) {
      const auto last = found.begin() + static_cast<std::ptrdiff_t>(points_end[n - begin]);
      states[n] = joined(at, last, states[n]);
      at = last;
    }
  }
  return states;
}

std::vector<RayState> path_states(const std::vector<Ray>& paths_world, const Eigen::Vector3f& box_size, bool stop_at_unknown, double step,
                                  const StatesOf& states_of, const FirstWithin& first_within) {
  check_step(step);
  check_size("The box on the paths", box_size);
  const BoxLattice lattice(box_size, step);
  std::vector<RayState> states;
  std::vector<Walk> walks;
  double samples = 0;
  for (std::size_t n = 0; n < paths_world.size(); ++n) {
    const Ray& path = paths_world[n];
    const double length = (path.to - path.from).cast<double>().norm();
    if (!std::isfinite(length)) throw Error("Path " + std::to_string(n) + " has an end that is not finite.");
    if (length > kMostPositions * step)
      throw Error("Path " + std::to_string(n) + " is " + to_text(length) + " m long, too much for steps of " + to_text(step) + " m.");
    walks.emplace_back(n, path, step);
    samples += lattice.points() + static_cast<double>(walks.back().positions() - 1) * lattice.points_of_front(walks.back().way());
    states.push_back({SpaceState::kFree, (path.to - path.from).norm()});
  }
  check_samples(samples, step);

  const auto positions = static_cast<std::size_t>(std::clamp(kFarthestAtOnce / step, 1.0, static_cast<double>(kPositionsAtOnce)));
  while (!walks.empty()) {
    for (auto walk = walks.begin(); walk != walks.end();) {
      Round round(lattice, box_size / 2, positions);
      for (; walk != walks.end() && !round.is_full(); ++walk) round.add(*walk);
      round.ask(stop_at_unknown, states_of, first_within, states);
    }
    walks.erase(std::remove_if(walks.begin(), walks.end(), [](const Walk& walk) { return walk.at_end(); }), walks.end());
  }
  return states;
}

}  // namespace frontier_surfels
