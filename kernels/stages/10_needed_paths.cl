// Needed paths: the paths that section 3.2 of the paper must walk are those near a candidate that the kept views have left open: through
// the 27 voxels around it, which the median looks at, and beside these, where the hull looks.
//
// lines: three fields, one after the other: i paths [size_j][words_k] and j paths [size_i][words_k], a bit each along k, in words of two
// 32-bit halves; k paths [size_j][size_i], a 32-bit number each that is not 0 if the path is needed.

INLINE int lines_i(const Grid* g, int j, int w) { return 2 * (j * g->words_k + w); }
INLINE int lines_j(const Grid* g, int i, int w) { return 2 * ((g->size_j + i) * g->words_k + w); }
INLINE int lines_k(const Grid* g, int i, int j) { return 2 * (g->size_i + g->size_j) * g->words_k + j * g->size_i + i; }

INLINE void or_word(__global uint* lines, int at, ulong bits) {
  const uint low = (uint)bits, high = (uint)(bits >> 32);
  if (low != 0) atomic_or(&lines[at], low);
  if (high != 0) atomic_or(&lines[at + 1], high);
}

// One work item handles a word of the bit fields, in word_index's order.
//   in  candidates: bit field by tiles;   i/o lines: zero before
__kernel void mark_lines(const Frame f, __global const ulong* candidates, __global uint* lines) {
  const int word = get_global_id(0);
  if (word >= f.grid.size_i * f.grid.size_j * f.grid.words_k) return;
  const int i = word % f.grid.size_i, w = word / f.grid.size_i % f.grid.words_k, j = word / f.grid.size_i / f.grid.words_k;
  const ulong open = candidates[tile_word_index(&f.grid, i, j, w)];
  if (open == 0) return;
  ulong below = 0, here = open, above = 0;  // the bits spread along k, also into the words below and above
  for (int n = 1; n <= LINE_MARGIN; ++n) {
    here |= (open << n) | (open >> n);
    below |= open << (64 - n);
    above |= open >> (64 - n);
  }
  for (int d = -LINE_MARGIN; d <= LINE_MARGIN; ++d) {
    for (int layer = -1; layer <= 1; ++layer) {
      const ulong bits = layer < 0 ? below : layer > 0 ? above : here;
      if (bits == 0 || w + layer < 0 || w + layer >= f.grid.words_k) continue;
      if (j + d >= 0 && j + d < f.grid.size_j) or_word(lines, lines_i(&f.grid, j + d, w + layer), bits);
      if (i + d >= 0 && i + d < f.grid.size_i) or_word(lines, lines_j(&f.grid, i + d, w + layer), bits);
    }
    for (int e = -LINE_MARGIN; e <= LINE_MARGIN; ++e)
      if (i + d >= 0 && i + d < f.grid.size_i && j + e >= 0 && j + e < f.grid.size_j) lines[lines_k(&f.grid, i + d, j + e)] = 1;
  }
}
