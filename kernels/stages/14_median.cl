// Median - paper 3.2, eq. (8): K~(v) = 1 iff at least median_votes of the 27 voxels around v have K' = 1. The grid's border repeats.

// A word's bits moved so that bit k holds what layer k + 1, k - 1 has.
INLINE ulong layer_above(const Grid* g, __global const ulong* field, int i, int j, int w) {
  const ulong here = field[word_index(g, i, j, w)];
  const ulong carry = w + 1 < g->words_k ? field[word_index(g, i, j, w + 1)] << 63 : 0;
  const int last = g->size_k - 1 - 64 * w;  // bit of the grid's last layer
  const ulong border = last < 64 ? here & (1ul << last) : 0;
  return (here >> 1) | carry | border;
}

INLINE ulong layer_below(const Grid* g, __global const ulong* field, int i, int j, int w) {
  const ulong here = field[word_index(g, i, j, w)];
  return (here << 1) | (w > 0 ? field[word_index(g, i, j, w - 1)] >> 63 : here & 1);
}

// One work item handles a word, in word_index's order: 64 counts at once, bit n of each count in plane n.
//   in  known: bit field K', zero beyond the last layer;  candidates: bit field by tiles: where a word has none, nobody asks for K~
//   out filtered: bit field K~, 0 in words without a candidate
__kernel void median(const Frame f, __global const ulong* known, __global const ulong* candidates, __global ulong* filtered) {
  const int word = get_global_id(0);
  if (word >= f.grid.size_i * f.grid.size_j * f.grid.words_k) return;
  const int i = word % f.grid.size_i, w = word / f.grid.size_i % f.grid.words_k, j = word / f.grid.size_i / f.grid.words_k;
  if (candidates[tile_word_index(&f.grid, i, j, w)] == 0) {
    filtered[word] = 0;
    return;
  }
  const ulong layers = valid_layers(&f.grid, w);

  ulong plane[5] = {0, 0, 0, 0, 0};
  for (int dj = -1; dj <= 1; ++dj) {
    for (int di = -1; di <= 1; ++di) {
      const int ni = clamp(i + di, 0, f.grid.size_i - 1), nj = clamp(j + dj, 0, f.grid.size_j - 1);
      const ulong a = layer_below(&f.grid, known, ni, nj, w), b = known[word_index(&f.grid, ni, nj, w)],
                  c = layer_above(&f.grid, known, ni, nj, w);
      const ulong ones = a ^ b ^ c, twos = (a & b) | (c & (a ^ b));  // their sum, two bits
      ulong carry = plane[0] & ones;
      plane[0] ^= ones;
      const ulong carry_1 = (plane[1] & twos) | (carry & (plane[1] ^ twos));
      plane[1] ^= twos ^ carry;
      carry = plane[2] & carry_1;
      plane[2] ^= carry_1;
      const ulong carry_3 = plane[3] & carry;
      plane[3] ^= carry;
      plane[4] ^= carry_3;
    }
  }

  ulong greater = 0, equal = ~0ul;  // the counts compared with the votes, highest bit first
  for (int bit = 4; bit >= 0; --bit) {
    const ulong votes = (f.limits.median_votes >> bit) & 1 ? ~0ul : 0;
    greater |= equal & plane[bit] & ~votes;
    equal &= ~(plane[bit] ^ votes);
  }
  filtered[word] = (greater | equal) & layers;
}
