/// Reading and writing the bit fields of the paths of section 3.2.
#pragma once

#include <vector>

#include "frame_fixture.hpp"
#include "stages/known_hull.hpp"
#include "stages/needed_paths.hpp"
#include "stages/sign_field.hpp"

namespace frontier_surfels {

using Bits = FrameFixture::Bits;

/// Restricts section 3.2 to the paths through the voxels around these candidates.
inline void need_paths_around(const FrameFixture& fixture, const Bits& bits, Candidates& candidates, NeededPaths& needed) {
  fixture.write(candidates, bits);
  needed.mark(fixture.frame(), candidates);
}

/// Paths to be walked: along i [size_j][1][size_k], along j [size_i][1][size_k], along k [size_j][1][size_i].
inline std::vector<Bits> read_paths(const Grid& grid, const NeededPaths& needed) {
  const std::vector<std::uint32_t> lines = needed.lines().read(NeededPaths::size(grid));
  std::vector<Bits> paths = {Bits(grid.size_j, 1, grid.size_k, 0), Bits(grid.size_i, 1, grid.size_k, 0),
                             Bits(grid.size_j, 1, grid.size_i, 0)};
  auto next = lines.begin();
  for (Bits* along : {&paths[0], &paths[1]})
    for (int row = 0; row < along->size_i; ++row)
      for (int half = 0; half < 2 * grid.words_k; ++half, ++next)
        for (int bit = 0; bit < 32 && 32 * half + bit < grid.size_k; ++bit) (*along)(row, 0, 32 * half + bit) = *next >> bit & 1;
  for (char& path : paths[2].values) path = *next++ != 0;
  return paths;
}

/// Index of the first word of a plane of events. @param family  0, 1, 2: paths along i, j, k; @param event  EVENT_ENTER_FORWARD and so on
inline std::size_t event_offset(const Grid& grid, int family, int event) { return (family * EVENT_PLANES + event) * words(grid); }

inline Bits unpack_face(const std::vector<std::uint64_t>& words, int rows, int columns, bool word_each) {
  const std::size_t words_row = words.size() / rows;
  Bits bits(rows, 1, columns, 0);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column)
      bits(row, 0, column) = word_each ? words[row * words_row + column] != 0 : words[row * words_row + column / 64] >> (column % 64) & 1;
  return bits;
}

/// States of the paths that enter through a face: [size_j][1][size_k] of the i faces, [size_i][1][size_k] of the j faces, and
/// [size_j][1][size_i] of the k faces.
inline std::vector<Bits> read_hull(const Grid& grid, const BitField& states) {
  const int i = grid.size_i, j = grid.size_j, k = grid.size_k;
  std::vector<Bits> faces;
  std::size_t at = 0;
  for (int face = FACE_I_LOW; face <= FACE_K_HIGH; ++face) {
    const bool along_k = face >= FACE_K_LOW;
    const int rows = face == FACE_J_LOW || face == FACE_J_HIGH ? i : j, columns = along_k ? i : k;
    const std::size_t row_words = along_k ? columns : grid.words_k;
    faces.push_back(unpack_face(states.read(rows * row_words, at), rows, columns, along_k));
    at += rows * row_words;
  }
  return faces;
}

inline void write_hull(BitField& states, const std::vector<Bits>& faces) {
  std::vector<std::uint64_t> hull;
  for (int face = FACE_I_LOW; face <= FACE_K_HIGH; ++face) {
    const Bits& bits = faces[face];
    const std::size_t row_words = face >= FACE_K_LOW ? bits.size_k : (bits.size_k + 63) / 64;
    for (int row = 0; row < bits.size_i; ++row) {
      std::vector<std::uint64_t> line(row_words, 0);
      for (int column = 0; column < bits.size_k; ++column) {
        if (!bits(row, 0, column)) continue;
        line[face >= FACE_K_LOW ? column : column / 64] |= face >= FACE_K_LOW ? 1 : std::uint64_t{1} << (column % 64);
      }
      hull.insert(hull.end(), line.begin(), line.end());
    }
  }
  states.write(hull);
}

}  // namespace frontier_surfels
