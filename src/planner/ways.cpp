#include "frontier_surfels/planner/ways.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <string>
#include <utility>

#include "config/config_text.hpp"

namespace frontier_surfels {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr double kMostPlaces = 1e8;
constexpr double kFarthest = 1e8;  // places from the origin

void check_range(const char* name, double value, double least, double most) {
  if (!(value >= least && value <= most))
    throw Error(std::string("The ways' ") + name + " is " + to_text(value) + " m: it must be from " + to_text(least) + " to " +
                to_text(most) + " m.");
}

void check(const Eigen::Vector3f& from, const WayOptions& options) {
  check_range("lattice", options.lattice, 0.02, 10);
  check_range("radius", options.radius, 0, 10);
  check_range("own_room", options.own_room, 0, 10);
  if (!std::isfinite(options.lowest) || !std::isfinite(options.highest) || options.lowest > options.highest)
    throw Error("The ways' lowest and highest must be finite, and in this order.");
  for (const Eigen::Vector3f& place : options.been)
    if (!place.allFinite()) throw Error("A place in the ways' been is not finite.");
  if (!from.allFinite()) throw Error("The place that the ways begin at (from) is not finite.");
}

}  // namespace

Ways::Ways(const StateGrid& grid, const Eigen::Vector3f& from, const WayOptions& options) : grid_(grid), from_(from), options_(options) {
  check(from, options);
  const auto [low, high] = grid.extent();
  const double block = StateBlock::kEdge * grid.resolution();
  Eigen::AlignedBox3d box;  // of all that can be open
  if (low[0] <= high[0])
    box = {block * Eigen::Vector3d(low[0], low[1], low[2]), block * Eigen::Vector3d(high[0] + 1, high[1] + 1, high[2] + 1)};
  for (const Eigen::Vector3f& place : options.been)
    box.extend(Eigen::AlignedBox3d(place.cast<double>().array() - options.own_room, place.cast<double>().array() + options.own_room));
  box.min().z() = std::max(box.min().z(), options.lowest);
  box.max().z() = std::min(box.max().z(), options.highest);
  if (box.isEmpty()) return;
  constexpr double kRounding = 1e-6;
  const Eigen::Array3d first = (box.min().array() / options.lattice - kRounding).ceil(),
                       last = (box.max().array() / options.lattice + kRounding).floor();
  const Eigen::Array3d size = (last - first + 1).max(0);
  if (size.prod() > kMostPlaces || first.minCoeff() < -kFarthest || last.maxCoeff() > kFarthest)
    throw Error("The ways' lattice of " + to_text(options.lattice) + " m is too fine for a grid as large, or as far away, as this.");
  low_ = first.cast<int>();
  size_ = size.cast<int>();
  length_.assign(static_cast<std::size_t>(size.prod()), kInfinite);
  before_.assign(length_.size(), -1);
  search();
}

std::size_t Ways::number(const Place& place) const {
  const Place p = place - low_;
  return (static_cast<std::size_t>(p.z()) * static_cast<std::size_t>(size_.y()) + static_cast<std::size_t>(p.y())) *
             static_cast<std::size_t>(size_.x()) +
         static_cast<std::size_t>(p.x());
}

Ways::Place Ways::place(std::size_t number) const {
  const auto x = static_cast<std::size_t>(size_.x()), y = static_cast<std::size_t>(size_.y());
  return low_ + Place(static_cast<int>(number % x), static_cast<int>(number / x % y), static_cast<int>(number / (x * y)));
}

Ways::Place Ways::nearest_place(const Eigen::Vector3f& p) const {
  constexpr double kFarther = kFarthest + 2;  // is beside no place of the lattice
  return (p.cast<double>().array() / options_.lattice).round().max(-kFarther).min(kFarther).cast<int>();
}

/// Is there room for the robot?
bool Ways::is_open(const Eigen::Vector3f& p) const {
  // A ball may touch what is not free: whether it does must not depend on how the float rounds.
  const double touching = 1e-3 * grid_.resolution();
  if (p.z() < options_.lowest - touching || p.z() > options_.highest + touching) return false;
  const auto radius = static_cast<float>(std::max(0.0, options_.radius - touching));
  const SpaceState own = grid_.state(p);
  if (own == SpaceState::kFree && grid_.clearance(p, radius) >= radius) return true;
  const auto is_near = [&](const Eigen::Vector3f& place) { return (p - place).norm() <= options_.own_room; };
  if (own == SpaceState::kOccupied || std::none_of(options_.been.begin(), options_.been.end(), is_near)) return false;
  const Eigen::Vector3f half = Eigen::Vector3f::Constant(radius);
  return grid_.box_state({p - half, p + half}) != SpaceState::kOccupied;
}

bool Ways::is_open_between(const Eigen::Vector3f& a, const Eigen::Vector3f& b) const {
  const double cell = grid_.resolution(), apart = std::clamp(options_.radius, cell / 2, 2 * cell);
  const int steps = std::max(1, static_cast<int>(std::ceil((b - a).norm() / apart)));
  for (int n = 0; n <= steps; ++n)
    if (!is_open(a + (b - a) * (static_cast<float>(n) / static_cast<float>(steps)))) return false;
  return true;
}

/// Can the robot go straight from one open place to another? It can if the balls there overlap: nothing stands between them.
bool Ways::is_step(const Eigen::Vector3f& a, const Eigen::Vector3f& b) const {
  return (b - a).norm() < 1.999 * options_.radius || is_open_between(a, b);
}

/// Can the robot leave the place where it is to an open one? If there is no room for it there, then only what it stands in is no obstacle.
bool Ways::is_first_step(const Eigen::Vector3f& to, bool from_open) const {
  if (from_open) return is_step(from_, to);
  const RayState back = grid_.ray_state({to, from_}, false);
  return back.state == SpaceState::kFree || back.distance > (to - from_).norm() - 2 * grid_.resolution();
}

void Ways::search() {
  using Entry = std::pair<float, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  enum : std::uint8_t { kNotAsked, kOpen, kClosed };
  std::vector<std::uint8_t> asked(length_.size(), kNotAsked);
  const auto reach = [&](const Place& place, float length, std::ptrdiff_t before) {
    if (!is_within(place)) return;
    const std::size_t n = number(place);
    if (length >= length_[n]) return;
    if (asked[n] == kNotAsked) asked[n] = is_open(position(place)) ? kOpen : kClosed;
    if (asked[n] == kClosed || !is_step(position(this->place(static_cast<std::size_t>(before))), position(place))) return;
    length_[n] = length;
    before_[n] = before;
    queue.push({length, n});
  };
  // The robot stands between places: the way begins at those around it.
  const Place own = nearest_place(from_);
  const bool from_open = is_open(from_);
  for (int m = 0; m < 27; ++m) {
    const Place begin = own + Place(m % 3 - 1, m / 3 % 3 - 1, m / 9 - 1);
    if (is_within(begin) && is_first_step(position(begin), from_open))
      reach(begin, (position(begin) - from_).norm(), static_cast<std::ptrdiff_t>(number(begin)));
  }
  while (!queue.empty()) {
    const auto [length, n] = queue.top();
    queue.pop();
    if (length > length_[n]) continue;
    for (int m = 0; m < 27; ++m) {
      const Place step(m % 3 - 1, m / 3 % 3 - 1, m / 9 - 1);
      const double edge = options_.lattice * std::sqrt(static_cast<double>(step.square().sum()));
      reach(place(n) + step, length + static_cast<float>(edge), static_cast<std::ptrdiff_t>(n));
    }
  }
}

/// The place beside a point over which the way to it is shortest; -1: there is none.
std::ptrdiff_t Ways::last_place(const Eigen::Vector3f& to) const {
  std::ptrdiff_t best = -1;
  float least = kInfinite;
  if (!is_open(to)) return best;
  for (int m = 0; m < 27; ++m) {
    const Place place = nearest_place(to) + Place(m % 3 - 1, m / 3 % 3 - 1, m / 9 - 1);
    if (!is_within(place)) continue;
    const float length = length_[number(place)] + (position(place) - to).norm();
    if (length >= least || !is_step(position(place), to)) continue;
    least = length;
    best = static_cast<std::ptrdiff_t>(number(place));
  }
  return best;
}

float Ways::length(const Eigen::Vector3f& to) const {
  if (to == from_) return 0;
  const std::ptrdiff_t last = last_place(to);
  return last < 0 ? kInfinite : length_[static_cast<std::size_t>(last)] + (position(place(static_cast<std::size_t>(last))) - to).norm();
}

std::vector<Eigen::Vector3f> Ways::way(const Eigen::Vector3f& to) const {
  if (to == from_) return {from_, to};
  std::ptrdiff_t n = last_place(to);
  if (n < 0) return {};
  std::vector<Eigen::Vector3f> all = {to};
  for (;; n = before_[static_cast<std::size_t>(n)]) {
    all.push_back(position(place(static_cast<std::size_t>(n))));
    if (before_[static_cast<std::size_t>(n)] == n) break;
  }
  all.push_back(from_);
  std::reverse(all.begin(), all.end());
  std::vector<Eigen::Vector3f> corners = {all.front()};
  for (std::size_t i = 0; i + 1 < all.size();) {
    std::size_t next = all.size() - 1;
    while (next > i + 1 && !is_open_between(all[i], all[next])) --next;
    corners.push_back(all[next]);
    i = next;
  }
  return corners;
}

std::vector<Eigen::Vector3f> Ways::places() const {
  std::vector<Eigen::Vector3f> reached;
  for (std::size_t n = 0; n < length_.size(); ++n)
    if (length_[n] < kInfinite) reached.push_back(position(place(n)));
  return reached;
}

}  // namespace frontier_surfels
