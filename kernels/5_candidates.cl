// Where new surfels may be created - paper 3.5, eq. (13): unobserved voxels beside observed ones that no surfel has taken.
// Whether they are known is asked of the recent views first, and of the surfels only where those leave it open.

// Normal of a surfel at voxel v, camera frame, not normalised: the mean direction to the observed ones of the 26 voxels around it.
float3 observed_direction(const Grid* g, __global const float* layer_depth, __global const ulong* observed, int3 v) {
  const float3 center = voxel_center(g, layer_depth, v);
  float3 sum = (float3)(0.0f);
  for (int dk = -1; dk <= 1; ++dk) {
    for (int dj = -1; dj <= 1; ++dj) {
      for (int di = -1; di <= 1; ++di) {
        const int3 u = v + (int3)(di, dj, dk);
        if (!inside_grid(g, u) || !test_bit(g, observed, u)) continue;  // v itself is not observed
        const float3 direction = voxel_center(g, layer_depth, u) - center;
        sum += direction / length(direction);
      }
    }
  }
  return sum;
}

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
