// Where new surfels may be created - paper 3.5, eq. (13): unobserved voxels beside observed ones that no surfel has taken.
// Whether they are known is asked of the recent views first, and of the surfels only where those leave it open.

// One work item a word.
//   in  observed: C~;  occupied_voxels: those of surviving surfels;   out candidates
__kernel void find_candidates(const Grid g, __global const ulong* observed, __global const ulong* occupied_voxels,
                              __global ulong* candidates) {
  const int word = get_global_id(0);
  if (word >= g.size_i * g.size_j * g.words_k) return;
  const int i = word % g.size_i, w = word / g.size_i % g.words_k, j = word / g.size_i / g.words_k;
  const ulong here = observed[word];
  ulong beside = (here << 1) | (here >> 1);
  if (w > 0) beside |= observed[word_index(&g, i, j, w - 1)] >> 63;
  if (w + 1 < g.words_k) beside |= observed[word_index(&g, i, j, w + 1)] << 63;
  if (i > 0) beside |= observed[word - 1];
  if (i + 1 < g.size_i) beside |= observed[word + 1];
  if (j > 0) beside |= observed[word_index(&g, i, j - 1, w)];
  if (j + 1 < g.size_j) beside |= observed[word_index(&g, i, j + 1, w)];
  candidates[word] = beside & ~here & ~occupied_voxels[word] & valid_layers(&g, w);
}
