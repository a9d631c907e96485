/// Inner product sign field D over the grid and one voxel around it, and its events, by definition - supplement B, Algorithm 1.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <vector>

#include "reference_field.hpp"

namespace frontier_surfels::reference {

/// A sum of whole numbers. The device's sum may differ by up to `slack`, the number of weights that may be rounded either way.
struct Sum {
  int value = 0;
  int slack = 0;
};

inline Truth greater(const Sum& a, const Sum& b) {
  if (a.value - a.slack > b.value + b.slack) return Truth::yes;
  return a.value + a.slack <= b.value - b.slack ? Truth::no : Truth::open;
}

class SignField {
 public:
  SignField(const Grid& g, const Limits& limits, const std::vector<ViewSurfel>& surfels) : limits_(limits) {
    for (int family = 0; family < 3; ++family) {
      sum_[family] = Field<Sum>(g.size_i + 2, g.size_j + 2, g.size_k + 2, Sum());
      invalid_[family] = Field<Truth>(g, Truth::no);
    }
    for (const ViewSurfel& surfel : surfels) add(g, surfel);
  }

  const Field<Truth>& invalid(int family) const { return invalid_[family]; }

  /// Does a family's path have this event in a voxel?
  Truth event(int family, int event, int i, int j, int k) const {
    const bool forward = event == EVENT_ENTER_FORWARD || event == EVENT_EXIT_FORWARD;
    const bool enter = event == EVENT_ENTER_FORWARD || event == EVENT_ENTER_BACKWARD;
    std::array<int, 3> next = {i, j, k};
    next[family] += forward ? 1 : -1;
    // A(m) = I D(v_m), and -A for minima, so that both kinds of event are maxima above the peak.
    const int sign = (forward ? 1 : -1) * (enter ? 1 : -1);
    const Sum here = times(sign, at(family, i, j, k)), there = times(sign, at(family, next[0], next[1], next[2]));
    return !invalid_[family](i, j, k) && greater(here, Sum{static_cast<int>(limits_.peak), 0}) && greater(here, there);
  }

 private:
  static Sum times(int sign, const Sum& sum) { return {sign * sum.value, sum.slack}; }
  const Sum& at(int family, int i, int j, int k) const { return sum_[family](i + 1, j + 1, k + 1); }

  void add(const Grid& g, const ViewSurfel& surfel) {
    for (int i = -1; i <= g.size_i; ++i)
      for (int j = -1; j <= g.size_j; ++j)
        for (int k = -1; k <= g.size_k; ++k)
          if (std::abs(k - surfel.k) <= std::max(surfel.reach, limits_.thickness)) add_to_voxel(g, surfel, i, j, k);
  }

  void add_to_voxel(const Grid& g, const ViewSurfel& s, int i, int j, int k) {
    const Eigen::Vector3d n(s.n_x, s.n_y, s.n_z);
    const double di = i - double(s.i), dj = j - double(s.j), dk = k - double(s.k);
    const Eigen::Vector3d u(di + s.ray_x * dk, dj + s.ray_y * dk, dk);
    const double t = limits_.thickness, rho = s.reach, along = u.dot(n), in_plane = (u - along * n).norm();
    const double e = std::sqrt(along * along / (t * t) + in_plane * in_plane / (rho * rho));
    constexpr double kTolerance = 1e-4;  // for e, and for distances [voxel]
    if (e > 1 + kTolerance) return;

    const double weight = SIGN_FIELD_ONE * std::max(1 - e, 0.0), fraction = weight - std::floor(weight);
    // The error of e^2 in float is about 5e-6. The error of its root is larger near zero.
    const bool undecided = std::abs(fraction - 0.5) < 1e-3 + SIGN_FIELD_ONE * 5e-6 / std::max(e, 0.003);
    std::array<double, 3> g_tau = {s.n_x, s.n_y, s.n_k};
    if (s.ragged != 0) g_tau = {0, 0, 0};  // our addition: a ragged surfel opens no path
    for (int family = 0; family < 3; ++family) {
      if (std::abs(g_tau[family]) > limits_.th_d) {
        Sum& sum = sum_[family](i + 1, j + 1, k + 1);
        sum.value += (g_tau[family] > 0 ? 1 : -1) * static_cast<int>(std::lround(weight));
        sum.slack += undecided;
      } else if (i >= 0 && j >= 0 && k >= 0 && i < g.size_i && j < g.size_j && k < g.size_k) {
        Truth& invalid = invalid_[family](i, j, k);
        invalid = invalid || (less(in_plane, rho / 2, kTolerance) && less(e, 1, kTolerance));
      }
    }
  }

  Limits limits_;
  std::array<Field<Sum>, 3> sum_;
  std::array<Field<Truth>, 3> invalid_;
};

}  // namespace frontier_surfels::reference
