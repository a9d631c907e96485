/// Shortest ways of a robot through what a StateGrid knows to be free.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "frontier_surfels/planner/state_grid.hpp"

namespace frontier_surfels {

/// What a way must be like.
struct WayOptions {
  double lattice = 0.2;  ///< [m] between the places that ways lead over. 0.02 to 10
  double radius = 0.25;  ///< [m] of the ball around the robot that must be free. 0 to 10
  double lowest = -1e3;  ///< [m] height of the robot's centre, at least ...
  double highest = 1e3;  ///< [m] ... and at most; less than a lattice apart, no place may be between them
  double own_room =
      0.8;  ///< [m] around `been`, 0 to 10: there the box around the ball may be unknown, because no camera sees around itself

  /// Where the robot has been, world frame [m]: its start, and what else it has not looked at from outside.
  std::vector<Eigen::Vector3f> been;
};

/// The shortest ways from one place to all others, over a lattice with 26 neighbours (Dijkstra). A way is open if the ball is free at its
/// end and at each place of the lattice on it; also between them, if they are so far apart that the balls do not overlap. The same grid
/// gives the same ways.
class Ways {
 public:
  /// @param grid  must outlive this, and stay as it is
  /// @param from  where the robot is, world frame [m]; it can leave that place even if it is not free
  /// @throws Error  an option is out of range, `from` is not finite, or the lattice would have more than 1e8 places
  Ways(const StateGrid& grid, const Eigen::Vector3f& from, const WayOptions& options = {});

  /// Length of the way to a point [m]; infinite: there is none, or no room for the robot at the point.
  float length(const Eigen::Vector3f& to) const;

  /// The corners of the way to a point, both ends included, as few as free space allows; empty: there is none.
  std::vector<Eigen::Vector3f> way(const Eigen::Vector3f& to) const;

  /// All places of the lattice that can be reached.
  std::vector<Eigen::Vector3f> places() const;

 private:
  using Place = Eigen::Array3i;
  bool is_within(const Place& place) const { return (place >= low_).all() && (place < low_ + size_).all(); }
  std::size_t number(const Place& place) const;
  Place place(std::size_t number) const;
  Place nearest_place(const Eigen::Vector3f& p) const;
  Eigen::Vector3f position(const Place& place) const { return (place.cast<double>() * options_.lattice).matrix().cast<float>(); }
  bool is_open(const Eigen::Vector3f& p) const;
  bool is_open_between(const Eigen::Vector3f& a, const Eigen::Vector3f& b) const;
  bool is_step(const Eigen::Vector3f& a, const Eigen::Vector3f& b) const;
  bool is_first_step(const Eigen::Vector3f& to, bool from_open) const;
  std::ptrdiff_t last_place(const Eigen::Vector3f& to) const;
  void search();

  const StateGrid& grid_;
  const Eigen::Vector3f from_;
  const WayOptions options_;
  Place low_ = Place::Zero(), size_ = Place::Zero();  ///< the lattice's lowest place, and its places along each axis
  std::vector<float> length_;                         ///< to each place [m]
  std::vector<std::ptrdiff_t> before_;                ///< the place before it on its way; its own number: the first one
};

}  // namespace frontier_surfels
