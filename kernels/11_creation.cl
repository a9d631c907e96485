// Creation - paper 3.5, eq. (14)-(16): a surfel at the centre of each candidate that has a normal.

// New surfel filter. One work item a word: candidates that are known, or whose directions cancel, make no surfel.
//   in  observed: C~;  known: K~;   i/o candidates
__kernel void filter_candidates(const Grid g, const Limits limits, __global const float* layer_depth, __global const ulong* observed,
                                __global const ulong* known, __global ulong* candidates) {
  const int word = get_global_id(0);
  if (word >= g.size_i * g.size_j * g.words_k) return;
  const int i = word % g.size_i, w = word / g.size_i % g.words_k, j = word / g.size_i / g.words_k;
  ulong kept = candidates[word] & ~known[word];
  for (ulong left = kept; left != 0; left &= left - 1) {
    const int bit = lowest_bit(left);
    if (length(observed_direction(&g, layer_depth, observed, (int3)(i, j, 64 * w + bit))) < limits.normal_min) kept &= ~(1ul << bit);
  }
  candidates[word] = kept;
}

// Normal of a new surfel: the mean direction; if that leaves known space again at 7/4 r (thin or ragged space), the direction to a single
// observed voxel nearest to it that does not, and the surfel is ragged.
float3 surfel_normal(const Grid* g, const View* view, __global const float* depths, __global const float* layer_depth,
                     __global const ulong* observed, int3 v, bool* ragged) {
  const float3 center = voxel_center(g, layer_depth, v);
  const float reach = 1.75f * 0.8660254f * voxel_size(g, center.z);
  const float3 mean = normalize(observed_direction(g, layer_depth, observed, v));
  *ragged = !view_knows(view, depths, center + reach * mean);
  if (!*ragged) return mean;
  float3 best = mean;
  float best_cosine = -1.0f;
  for (int n = 0; n < 27; ++n) {
    const int3 u = v + (int3)(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
    if (!inside_grid(g, u) || !test_bit(g, observed, u)) continue;
    const float3 direction = normalize(voxel_center(g, layer_depth, u) - center);
    const float cosine = dot(direction, mean);
    if (cosine > best_cosine && view_knows(view, depths, center + reach * direction)) {
      best = direction;
      best_cosine = cosine;
    }
  }
  return best;
}

// Where in its voxel a surfel stands: slid along its normal until it is near the boundary, in steps of a tenth of a voxel. A step is left
// in hand before what this view or a kept one knows, and a surfel that has known space before it (at 7/4 r) does not lose it.
float3 slide_to_boundary(const Grid* g, const View* view, __global const View* views, int view_count, __global const float* depths, int3 v,
                         float3 center, float3 normal) {
  const float size = voxel_size(g, center.z);
  const float3 step = 0.1f * size * normal, front = 1.75f * 0.8660254f * size * normal;
  const bool has_front = view_knows(view, depths, center + front);
  int steps = 0;
  while (steps < 4) {
    const float3 next = center + (float)(steps + 1) * step;
    if (any(voxel_of(to_grid(g, next)) != v) || view_knows(view, depths, next) || view_knows(view, depths, next + step)) break;
    if (has_front && !view_knows(view, depths, next + front)) break;
    ++steps;
  }
  while (steps > 0 && (any_view_knows(views, view_count, depths, center + (float)(steps + 1) * step) ||
                       any_view_knows(views, view_count, depths, center + (float)steps * step)))
    --steps;
  return center + (float)steps * step;
}

// One work item a new surfel.
//   in  voxels[count]: 64 word + bit of each candidate;  refine: whether they leave their voxel's centre and mean normal
//       view: this frame's, views[view_count]: the kept ones, both in this frame's camera;  depths: their images
//   out new_surfels, new_cells: for the map
__kernel void create_surfels(const Grid g, const Limits limits, const Window window, const Transform T_local_camera, const int refine,
                             const View view, __global const View* views, const int view_count, __global const float* depths,
                             __global const float* layer_depth, __global const ulong* observed, __global const uint* voxels,
                             const uint count, __global uint4* new_surfels, __global uint* new_cells) {
  const uint n = get_global_id(0);
  if (n >= count) return;
  const int word = voxels[n] / 64, i = word % g.size_i, w = word / g.size_i % g.words_k, j = word / g.size_i / g.words_k;
  const int3 v = (int3)(i, j, 64 * w + voxels[n] % 64);
  const float3 p = voxel_center(&g, layer_depth, v);
  bool ragged = false;
  const float3 normal = refine ? surfel_normal(&g, &view, depths, layer_depth, observed, v, &ragged)
                               : normalize(observed_direction(&g, layer_depth, observed, v));
  const float3 placed = refine ? slide_to_boundary(&g, &view, views, view_count, depths, v, p, normal) : p;
  uint cell;
  new_surfels[n] = pack_surfel(&window, transform_point(&T_local_camera, placed), limits.create_radius * voxel_size(&g, p.z),
                               rotate(&T_local_camera, normal), ragged ? SURFEL_RAGGED : 0, &cell);
  new_cells[n] = cell;
}
