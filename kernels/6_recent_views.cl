// Recent views: our addition to the paper. A candidate whose centre a kept view has seen is known: no surfel there.

// Are both ends of a segment outside the image, or behind it, on the same side? Then all of it is.
INLINE bool segment_outside(const View* view, float3 a, float3 b) {
  if (a.z <= 0.0f && b.z <= 0.0f) return true;
  const float left = view->cx + 0.5f, right = (float)view->width - 0.5f - view->cx;
  const float top = view->cy + 0.5f, bottom = (float)view->height - 0.5f - view->cy;
  return (a.x * view->fx < -left * a.z && b.x * view->fx < -left * b.z) || (a.x * view->fx > right * a.z && b.x * view->fx > right * b.z) ||
         (a.y * view->fy < -top * a.z && b.y * view->fy < -top * b.z) || (a.y * view->fy > bottom * a.z && b.y * view->fy > bottom * b.z);
}

// One work item a word. Its voxels' centres lie on one line a + z b, in the camera's frame and in every view's.
//   in  views[view_count]: T_camera_world is from this frame's camera to the view's;  depths: their images;  layer_depth[size_k]
//   i/o candidates: those that a view knows are cleared
__kernel void settle_candidates(const Grid g, __global const View* views, const int view_count, __global const float* depths,
                                __global const float* layer_depth, __global ulong* candidates) {
  const int word = get_global_id(0);
  if (word >= g.size_i * g.size_j * g.words_k) return;
  const int i = word % g.size_i, w = word / g.size_i % g.words_k, j = word / g.size_i / g.words_k;
  // A word may hold layers of both parts of the grid.
  const ulong cuboid = bit_run(0, g.first_pyramid_layer - 64 * w);
  for (int part = 0; part < 2; ++part) {
    const bool pyramid = part == 1;
    ulong open = candidates[word] & (pyramid ? ~cuboid : cuboid);
    if (open == 0) continue;
    const float2 c = (float2)((float)i - g.center_i, (float)j - g.center_j);
    const float3 direction = pyramid ? (float3)(c.x / g.fx, c.y / g.fy, 1.0f) : (float3)(0.0f, 0.0f, 1.0f);
    const float3 base = pyramid ? (float3)(0.0f) : (float3)(c.x * g.z_min / g.fx, c.y * g.z_min / g.fy, 0.0f);
    ulong settled = 0;
    for (int v = 0; v < view_count && open != 0; ++v) {
      const View view = views[v];
      const float3 a = transform_point(&view.T_camera_world, base), b = rotate(&view.T_camera_world, direction);
      const float z_first = layer_depth[64 * w + lowest_bit(open)], z_last = layer_depth[64 * w + highest_bit(open)];
      if (segment_outside(&view, a + z_first * b, a + z_last * b)) continue;
      ulong known = 0;
      for (ulong left = open; left != 0; left &= left - 1) {
        const int bit = lowest_bit(left);
        if (view_knows(&view, depths, a + layer_depth[64 * w + bit] * b)) known |= 1ul << bit;
      }
      open &= ~known;
      settled |= known;
    }
    candidates[word] &= ~settled;
  }
}

// Does this view, or a kept one, know a point of this frame's camera?
INLINE bool any_view_knows(__global const View* views, int view_count, __global const float* depths, float3 p) {
  for (int n = 0; n < view_count; ++n) {
    const View view = views[n];
    const float3 q = transform_point(&view.T_camera_world, p);
    if (q.z > 0.0f && view_knows(&view, depths, q)) return true;
  }
  return false;
}

// Frontier on a sheet of unknown thinner than min_gap, known on both sides, bounds nothing worth a look: left out. A thin body's surfaces
// stay. One work item a word.
//   in  observed: C~;  depth, column_end: of 2_observed_space;  view: this frame's, views[view_count]: the kept ones, both in this
//       frame's camera;  depths: their images
//   i/o candidates: those with known space again `min_gap` behind them are cleared
__kernel void close_gaps(const Grid g, const Limits limits, const View view, __global const View* views, const int view_count,
                         __global const float* depths, __global const float* layer_depth, __global const float* depth,
                         __global const int* column_end, __global const ulong* observed, __global ulong* candidates) {
  const int word = get_global_id(0);
  if (word >= g.size_i * g.size_j * g.words_k) return;
  const int i = word % g.size_i, w = word / g.size_i % g.words_k, j = word / g.size_i / g.words_k;
  ulong kept = candidates[word];
  for (ulong left = kept; left != 0; left &= left - 1) {
    const int bit = lowest_bit(left);
    const int3 v = (int3)(i, j, 64 * w + bit);
    const float3 center = voxel_center(&g, layer_depth, v);
    const int pixel = pixel_of(&g, v);
    if (pixel >= 0 && at_surface(&g, depth[pixel], column_end[pixel], limits.surface_depth, v.z, center.z)) continue;
    const float3 direction = observed_direction(&g, layer_depth, observed, v);
    if (length(direction) < limits.normal_min) continue;
    const float3 behind = center - limits.min_gap * normalize(direction);
    if (view_knows(&view, depths, behind) || any_view_knows(views, view_count, depths, behind)) kept &= ~(1ul << bit);
  }
  candidates[word] = kept;
}

// Paths that section 4 must still walk: those through the 27 voxels around a candidate, and their neighbours, which the hull looks at.
// Three fields, one after the other: i paths [size_j][words_k] and j paths [size_i][words_k], a bit each along k; k paths [size_j][size_i],
// a 32-bit number each.
#define LINE_MARGIN 2

INLINE int lines_i(const Grid* g, int j, int w) { return 2 * (j * g->words_k + w); }
INLINE int lines_j(const Grid* g, int i, int w) { return 2 * ((g->size_j + i) * g->words_k + w); }
INLINE int lines_k(const Grid* g, int i, int j) { return 2 * (g->size_i + g->size_j) * g->words_k + j * g->size_i + i; }

INLINE void or_word(__global uint* lines, int at, ulong bits) {
  const uint low = (uint)bits, high = (uint)(bits >> 32);
  if (low != 0) atomic_or(&lines[at], low);
  if (high != 0) atomic_or(&lines[at + 1], high);
}

// One work item a word.
//   i/o lines: zero before
__kernel void mark_lines(const Grid g, __global const ulong* candidates, __global uint* lines) {
  const int word = get_global_id(0);
  if (word >= g.size_i * g.size_j * g.words_k) return;
  const ulong open = candidates[word];
  if (open == 0) return;
  const int i = word % g.size_i, w = word / g.size_i % g.words_k, j = word / g.size_i / g.words_k;
  ulong below = 0, here = open, above = 0;  // the bits spread along k, into the words beside as well
  for (int n = 1; n <= LINE_MARGIN; ++n) {
    here |= (open << n) | (open >> n);
    below |= open << (64 - n);
    above |= open >> (64 - n);
  }
  for (int d = -LINE_MARGIN; d <= LINE_MARGIN; ++d) {
    for (int layer = -1; layer <= 1; ++layer) {
      const ulong bits = layer < 0 ? below : layer > 0 ? above : here;
      if (bits == 0 || w + layer < 0 || w + layer >= g.words_k) continue;
      if (j + d >= 0 && j + d < g.size_j) or_word(lines, lines_i(&g, j + d, w + layer), bits);
      if (i + d >= 0 && i + d < g.size_i) or_word(lines, lines_j(&g, i + d, w + layer), bits);
    }
    for (int e = -LINE_MARGIN; e <= LINE_MARGIN; ++e)
      if (i + d >= 0 && i + d < g.size_i && j + e >= 0 && j + e < g.size_j) lines[lines_k(&g, i + d, j + e)] = 1;
  }
}
