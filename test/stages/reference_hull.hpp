/// Known state hull, computed cell by cell - supplement C.
#pragma once

#include <cmath>
#include <vector>

#include "reference_surfels.hpp"

namespace frontier_surfels::reference {

struct Hit {
  double distance;
  Truth known;
  Truth hit;
};

class Hull {
 public:
  Hull(const Nuvg& grid, double th_d, double unknown_scale, const std::vector<SeenSurfel>& surfels)
      : th_d_(th_d), unknown_scale_(unknown_scale) {
    const std::array<int, 3> size = {grid.size_i, grid.size_j, grid.size_k};
    for (int face = FACE_I_LOW; face <= FACE_K_HIGH; ++face) {
      const int along = face / 2, row_axis = along == 1 ? 0 : 1, column_axis = along == 2 ? 0 : 2;
      Field<std::vector<Hit>> hits(size[row_axis], 1, size[column_axis], {});
      for (const SeenSurfel& surfel : surfels) project(surfel, along, face % 2 == 0, size[along], row_axis, column_axis, hits);
      faces_.push_back(states(hits));
    }
  }

  /// State of each cell, [row][1][column]: [j][1][k] for the i faces, [i][1][k] for the j faces, [j][1][i] for the k faces.
  const Field<Truth>& face(int number) const { return faces_[number]; }

 private:
  static constexpr double kTolerance = 1e-3;  // [voxel]

  void project(const SeenSurfel& s, int along, bool low, int size, int row_axis, int column_axis, Field<std::vector<Hit>>& hits) const {
    const double distance = low ? -0.5 - s.c[along] : s.c[along] - (size - 0.5);
    const Truth beyond = less(0, distance, kTolerance);
    if (beyond == Truth::no) return;
    const std::array<double, 3> cosine = {s.normal.x(), s.normal.y(), s.n_k};
    const Truth known = truth(!s.ragged) && less(th_d_, low ? cosine[along] : -cosine[along], 1e-5);
    for (int row = 0; row < hits.size_i; ++row)
      for (int column = 0; column < hits.size_k; ++column) {
        const auto covers = [&](bool as_known) {
          const double scale = as_known ? 1 : unknown_scale_;
          const auto part = [&](int axis, int cell) {
            const double half_axis = scale * s.rho * std::sqrt(std::max(0.0, 1 - cosine[axis] * cosine[axis]));
            return (cell - s.c[axis]) / std::max(half_axis, 0.5);
          };
          return less(std::hypot(part(row_axis, row), part(column_axis, column)), 1, kTolerance);
        };
        Truth hit = known == Truth::no ? covers(false) : covers(true);
        if (known == Truth::open && covers(false) != hit) hit = Truth::open;
        hit = hit && beyond;
        if (hit != Truth::no) hits(row, 0, column).push_back({distance, known, hit});
      }
  }

  /// State of the nearest surfel that is hit; in a tie unknown wins. Open: surfels that are as near, or may not be hit, say otherwise.
  static Truth nearest(const std::vector<Hit>& hits) {
    double certain = std::numeric_limits<double>::infinity();
    for (const Hit& hit : hits)
      if (hit.hit == Truth::yes) certain = std::min(certain, hit.distance);
    bool yes = false, no = false;
    for (const Hit& hit : hits) {
      if (hit.distance > certain + kTolerance) continue;
      yes = yes || hit.known != Truth::no;
      no = no || hit.known != Truth::yes;
    }
    return yes && no ? Truth::open : truth(yes);
  }

  /// Was any surfel met?
  static Truth met(const std::vector<Hit>& hits) {
    Truth met = Truth::no;
    for (const Hit& hit : hits) met = met || hit.hit;
    return met;
  }

  static Field<Truth> states(const Field<std::vector<Hit>>& hits) {
    Field<Truth> known(hits.size_i, 1, hits.size_k, Truth::no);
    for_each_voxel(hits, [&](int row, int, int column) {
      Truth& state = known(row, 0, column);
      state = nearest(hits(row, 0, column)) && met(hits(row, 0, column));
      const int beside[4][2] = {{row - 1, column}, {row + 1, column}, {row, column - 1}, {row, column + 1}};
      for (const auto& cell : beside)
        if (hits.contains(cell[0], 0, cell[1])) state = state && met(hits(cell[0], 0, cell[1]));
    });
    return known;
  }

  double th_d_, unknown_scale_;
  std::vector<Field<Truth>> faces_;
};

}  // namespace frontier_surfels::reference
