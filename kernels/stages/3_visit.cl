// What a frame asks of the map's surfels, in one pass: which are in view and which of them must be split - paper 3.4 -, which are removed
// - eq. (12): surfels in observed space go; voxels of the others are no candidates for new ones -, and which are to be labelled
// (16_labels). Ours: surfels go also where this frame has seen their back, and frontier on a sheet of unknown thinner than min_gap.

// Which of LANES surfels have an ellipsoid that may reach into the grid, generously.
INLINE int16 reach_grid(const Grid* g, const Limits* limits, const Surfels* s, float16 voxel) {
  const Points p = s->position;
  const float16 slope = 1.0f / fmax(p.z, g->z_min);
  const float16 reach = fmax(2.0f * s->radius / voxel, limits->thickness) + 1.5f;
  const float16 i = p.x * slope * g->fx + g->center_i, j = p.y * slope * g->fy + g->center_j;
  const float16 reach_i = reach * (1.0f + fabs(p.x * slope)), reach_j = reach * (1.0f + fabs(p.y * slope));
  return (p.z >= -((float)g->padding_k + reach) * voxel) & (p.z <= g->z_max + 2.0f * reach * voxel) & (i > -reach_i) &
         (i < (float)g->size_i + reach_i) & (j > -reach_j) & (j < (float)g->size_j + reach_j);
}

// Which surfels go, of those inside the grid.
INLINE int16 leaves(const Limits* limits, const View* view, int remove_buried, __global const ushort* depths, const Surfels* s,
                    Points normal, int16 inside) {
  int16 gone = 0;
  if (remove_buried) gone |= own_view_knows(view, depths, add_scaled(s->position, -0.25f * s->radius, normal), inside);
  if (limits->min_gap > 0.0f)
    gone |= own_view_knows(view, depths, add_scaled(s->position, -limits->min_gap, normal),
                           inside & ~gone & ((s->attributes & SURFEL_OCCUPIED) == 0));
  return gone;
}

// Takes voxels off the candidates.
//   at, bit: numbers of 32-bit halves of words, and bits of them
INLINE void clear_candidates(__global int* candidates, int16 at, int16 bit, int16 taken) {
  int words[LANES], bits[LANES];
  vstore16(at, 0, words);
  vstore16(bit, 0, bits);
  for (uint left = lane_bits(taken); left != 0; left &= left - 1) {
    const int n = lowest_lane(left);
    atomic_and(&candidates[words[n]], ~bits[n]);
  }
}

// What is found out of a page's surfels, a bit each.
typedef struct {
  ushort in_view[PAGE_ITEMS], large[PAGE_ITEMS], removed[PAGE_ITEMS], labelled[PAGE_ITEMS];
} PageLanes;

// One work item LANES surfels of a page of the window.
//   in  pages[count]: those of the window;  observed: C~, as 32-bit halves;  view: this frame as its own camera sees it, depths: its
//       image, for the exact test;  depth, column_end: of 1_observed_space
//   i/o candidates: as 32-bit halves: voxels of surfels that stay are taken off;  changed: those that stay and that 16_labels will label
//       counts: COUNT_IN_VIEW, COUNT_LARGE, COUNT_REMOVED
//   out in_view[count], large[count], removed[count]
__kernel __attribute__((reqd_work_group_size(PAGE_GROUP, 1, 1))) void visit_surfels(
    const Grid g, const Limits limits, const Window window, const Transform T_camera_local, const View view, const int remove_buried,
    const int has_color, __global const ushort* depths, __global const float* depth, __global const int* column_end,
    __global const uint* pages, const uint count, __global const ulong* alive, __global const int4* page_block,
    __global const uint4* surfels, __global const int* observed, __global int* candidates, __global ulong* changed, __global ulong* in_view,
    __global ulong* large, __global ulong* removed, __global uint* counts) {
  __local PageLanes all_found[PAGE_GROUP / PAGE_ITEMS];
  const uint n = get_global_id(0) / PAGE_ITEMS, item = get_local_id(0) % PAGE_ITEMS;
  __local PageLanes* found = &all_found[get_local_id(0) / PAGE_ITEMS];
  const uint page = pages[min(n, count - 1)], first = PAGE_SLOTS * page + LANES * item;
  found->in_view[item] = found->large[item] = found->removed[item] = found->labelled[item] = 0;
  const uint next = pages[min(n + 3, count - 1)];  // pages lie anywhere in the map
  for (int m = 0; m < LANES; m += 4) PREFETCH(surfels + PAGE_SLOTS * next + LANES * item + m);
  const uint lanes = n < count ? lanes_of_page(alive[page], first) : 0;
  if (lanes != 0) {
    const Surfels s = load_surfels(&window, &T_camera_local, surfels, page_block[page], first);
    const float16 voxel = voxel_sizes(&g, s.position.z);
    const int16 seen = reach_grid(&g, &limits, &s, voxel) & lane_marks(lanes);
    found->in_view[item] = (ushort)lane_bits(seen);
    if (lane_bits(seen) != 0) {
      const Voxels v = voxels_at(&g, s.position);
      const int16 inside = inside_grid16(&g, v) & seen;
      found->large[item] = (ushort)lane_bits(inside & (s.radius / voxel >= limits.split_radius));
      const int16 bit = half_bits(v.k), candidate = inside ? candidate_halves(&g, v) : 0;
      const int16 is_candidate = inside & ((gather_int(candidates, candidate) & bit) != 0);
      // Candidates are not observed: that is asked of the others alone.
      const int16 rest = inside & ~is_candidate, at = rest ? voxel_halves(&g, v) : 0;
      int16 stay = is_candidate | (rest & ((gather_int(observed, at) & bit) == 0));
      stay &= ~leaves(&limits, &view, remove_buried, depths, &s, stored_normals(&s, &T_camera_local), stay);
      found->removed[item] = (ushort)lane_bits(inside & ~stay);
      int16 pixel;
      const int16 unlabelled = stay & lacks_label(s.attributes, has_color);
      found->labelled[item] =
          (ushort)lane_bits(at_surface(&g, depth, column_end, limits.surface_depth, v, s.position.z, unlabelled, &pixel));
      clear_candidates(candidates, candidate, bit, stay & is_candidate);
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item > 0 || n >= count) return;
  const ulong in_view_here = pack_lanes(found->in_view), large_here = pack_lanes(found->large), removed_here = pack_lanes(found->removed);
  in_view[n] = in_view_here;
  large[n] = large_here;
  removed[n] = removed_here;
  changed[page] |= pack_lanes(found->labelled);
  if (in_view_here != 0) atomic_add(&counts[COUNT_IN_VIEW], (uint)popcount(in_view_here));
  if (large_here != 0) atomic_add(&counts[COUNT_LARGE], (uint)popcount(large_here));
  if (removed_here != 0) atomic_add(&counts[COUNT_REMOVED], (uint)popcount(removed_here));
}
