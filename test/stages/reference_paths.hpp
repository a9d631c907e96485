/// Sweeps, one path at a time (Algorithm 1), the median (eq. 8), and candidates (eq. 13).
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "reference_field.hpp"

namespace frontier_surfels::reference {

/// [family][event]
using Events = std::array<std::array<Field<char>, EVENT_PLANES>, 3>;

/// Walks a path from voxel `at` in direction `step` to the end of the grid, starting with state e.
inline void walk(const std::array<Field<char>, EVENT_PLANES>& events, int enter, int exit, std::array<int, 3> at, std::array<int, 3> step,
                 bool e, Field<char>& known) {
  while (known.contains(at[0], at[1], at[2])) {
    const auto here = [&](const Field<char>& field) { return field(at[0], at[1], at[2]) != 0; };
    if (here(events[EVENT_INVALID])) {
      e = false;
    } else {
      if (here(events[exit])) e = false;
      if (e) known(at[0], at[1], at[2]) = 1;
      if (here(events[enter])) e = true;
    }
    for (int axis = 0; axis < 3; ++axis) at[axis] += step[axis];
  }
}

/// K': the OR of the six sweeps.
/// @param hull  state of the paths at each face: [size_j][1][size_k] (i faces), [size_i][1][size_k] (j), [size_j][1][size_i] (k)
inline Field<char> sweep(const Events& events, const std::vector<Field<char>>& hull) {
  const Field<char>& any = events[0][0];
  Field<char> known(any.size_i, any.size_j, any.size_k, 0);
  const auto both_ways = [&](int family, std::array<int, 3> low, std::array<int, 3> high, bool from_low, bool from_high) {
    std::array<int, 3> forward = {0, 0, 0}, backward = {0, 0, 0};
    forward[family] = 1;
    backward[family] = -1;
    walk(events[family], EVENT_ENTER_FORWARD, EVENT_EXIT_FORWARD, low, forward, from_low, known);
    walk(events[family], EVENT_ENTER_BACKWARD, EVENT_EXIT_BACKWARD, high, backward, from_high, known);
  };
  for (int j = 0; j < any.size_j; ++j)
    for (int k = 0; k < any.size_k; ++k)
      both_ways(0, {0, j, k}, {any.size_i - 1, j, k}, hull[FACE_I_LOW](j, 0, k), hull[FACE_I_HIGH](j, 0, k));
  for (int i = 0; i < any.size_i; ++i)
    for (int k = 0; k < any.size_k; ++k)
      both_ways(1, {i, 0, k}, {i, any.size_j - 1, k}, hull[FACE_J_LOW](i, 0, k), hull[FACE_J_HIGH](i, 0, k));
  for (int i = 0; i < any.size_i; ++i)
    for (int j = 0; j < any.size_j; ++j)
      both_ways(2, {i, j, 0}, {i, j, any.size_k - 1}, hull[FACE_K_LOW](j, 0, i), hull[FACE_K_HIGH](j, 0, i));
  return known;
}

/// K~: voxels with at least `votes` known ones among the 27 around and including them. Beyond the grid the border voxels repeat.
inline Field<char> median(const Field<char>& known, int votes) {
  Field<char> filtered(known.size_i, known.size_j, known.size_k, 0);
  for_each_voxel(known, [&](int i, int j, int k) {
    int count = 0;
    for (int di = -1; di <= 1; ++di)
      for (int dj = -1; dj <= 1; ++dj)
        for (int dk = -1; dk <= 1; ++dk)
          count += known(std::clamp(i + di, 0, known.size_i - 1), std::clamp(j + dj, 0, known.size_j - 1),
                         std::clamp(k + dk, 0, known.size_k - 1));
    filtered(i, j, k) = count >= votes;
  });
  return filtered;
}

/// Candidates for new surfels - eq. (13) without the conditions on known space and existing surfels: unobserved voxels with an observed
/// 6-neighbour.
inline Field<char> candidates(const Field<char>& observed) {
  Field<char> found(observed.size_i, observed.size_j, observed.size_k, 0);
  const std::array<std::array<int, 3>, 6> sides = {{{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}}};
  for_each_voxel(observed, [&](int i, int j, int k) {
    bool beside = false;
    for (const auto& side : sides) {
      const int ni = i + side[0], nj = j + side[1], nk = k + side[2];
      if (observed.contains(ni, nj, nk) && observed(ni, nj, nk)) beside = true;
    }
    found(i, j, k) = beside && !observed(i, j, k);
  });
  return found;
}

/// Voxels at most `margin` away from a candidate along each axis.
inline Field<char> around(const Field<char>& candidates, int margin) {
  Field<char> found(candidates.size_i, candidates.size_j, candidates.size_k, 0);
  for_each_voxel(candidates, [&](int i, int j, int k) {
    if (!candidates(i, j, k)) return;
    for (int di = -margin; di <= margin; ++di)
      for (int dj = -margin; dj <= margin; ++dj)
        for (int dk = -margin; dk <= margin; ++dk)
          if (found.contains(i + di, j + dj, k + dk)) found(i + di, j + dj, k + dk) = 1;
  });
  return found;
}

/// The paths through some voxels: along i [size_j][1][size_k], along j [size_i][1][size_k], along k [size_j][1][size_i].
inline std::vector<Field<char>> paths_through(const Field<char>& voxels) {
  std::vector<Field<char>> paths = {Field<char>(voxels.size_j, 1, voxels.size_k, 0), Field<char>(voxels.size_i, 1, voxels.size_k, 0),
                                    Field<char>(voxels.size_j, 1, voxels.size_i, 0)};
  for_each_voxel(voxels, [&](int i, int j, int k) {
    if (!voxels(i, j, k)) return;
    paths[0](j, 0, k) = paths[1](i, 0, k) = paths[2](j, 0, i) = 1;
  });
  return paths;
}

inline bool on_path(const std::vector<Field<char>>& paths, int family, int i, int j, int k) {
  return family == 0 ? paths[0](j, 0, k) : family == 1 ? paths[1](i, 0, k) : paths[2](j, 0, i);
}

}  // namespace frontier_surfels::reference
